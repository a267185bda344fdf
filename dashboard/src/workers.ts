// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The workers: their present task, speed and memory.

import type {Worker} from './api';
import {badge, byId, child, el, setBadge, setText} from './dom';
import * as format from './format';
import type {Store} from './store';
import {VirtualList} from './virtual_list';
import {cacheOf, doingOf, titleOf} from './worker_words';

// "Seen 3 s ago" changes without an event.
const AGE_MS = 1000;

export class WorkersView {
  private readonly list: VirtualList<Worker>;

  constructor(private readonly store: Store) {
    this.list = new VirtualList(byId('workers'), {
      label: 'Workers',
      rowHeightProperty: '--worker-row',
      makeRow,
      updateRow: (row, worker) => this.updateRow(row, worker),
      keyOf: (worker) => worker.name,
    });
    for (const topic of ['workers', 'view'] as const) store.listen(topic, this.draw);
    setInterval(this.draw, AGE_MS);
  }

  private readonly draw = () => {
    if (this.store.view !== 'image') return;
    const workers = this.store.workers.sorted;
    setText(byId('worker-count'), format.exact(workers.length));
    byId('workers-empty').hidden = workers.length > 0;
    byId('workers').hidden = workers.length === 0;
    this.list.setItems(workers, null);
  };

  private updateRow(row: HTMLElement, worker: Worker) {
    const [top, middle, bottom] = [child(row, 0), child(row, 1), child(row, 2)];
    setText(child(top, 0), titleOf(worker));
    const doing = doingOf(this.store, worker);
    const title = [doing, worker.numeric_profile, placeOf(worker)].join('\n') + scenesOf(worker);
    if (row.title !== title) row.title = title;
    setBadge(child(top, 1), worker.state);
    row.dataset.state = worker.state;
    setText(child(middle, 0), worker.reason || doing);
    setText(child(middle, 1), 'seen ' + format.ago(worker.last_seen_time));
    setText(child(bottom, 0), speedOf(worker));
    setText(child(bottom, 1), cacheOf(worker));
  }
}

function makeRow(): HTMLElement {
  const line = () =>
      el('div', {class: 'job-line job-small'}, el('span', {class: 'job-facts'}), el('span'));
  return el(
      'div', {class: 'worker-row'},
      el('div', {class: 'job-line'}, el('span', {class: 'job-title'}), badge('idle')), line(),
      line());
}

function speedOf(worker: Worker): string {
  const threads = worker.thread_count === 1 ? '1 thread' : worker.thread_count + ' threads';
  const results =
      worker.result_count === 1 ? '1 result' : format.exact(worker.result_count) + ' results';
  return [format.count(worker.samples_per_second) + '/s', threads, results].join(' · ');
}

// "pool big, tags avx, ssd".
function placeOf(worker: Worker): string {
  const tags = worker.tags;
  const tagged = tags.length > 0 ? ', tags ' + tags.join(', ') : '';
  return 'pool ' + (worker.pool ?? 'default') + tagged;
}

function scenesOf(worker: Worker): string {
  const more = worker.warm_scene_count - worker.warm_scenes.length;
  const names = worker.warm_scenes.join('\n') + (more > 0 ? '\nand ' + more + ' more' : '');
  const loads = worker.lease_granted_count > 0 ? '\nScenes loaded for ' + worker.lease_cold_count +
          ' of ' + worker.lease_granted_count + ' leases' :
                                                 '';
  return loads + (names ? '\nScenes in its memory:\n' + names : '');
}
