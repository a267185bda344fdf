// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The workers, with what each holds and how fast it is.

import type {Worker} from './api';
import {badge, byId, child, el, setBadge, setText} from './dom';
import * as format from './format';
import type {Store} from './store';
import {VirtualList} from './virtual_list';

// "Seen 3 s ago" grows old without an event.
const AGE_MS = 1000;

export class WorkersView {
  private readonly list: VirtualList<Worker>;

  constructor(private readonly store: Store) {
    this.list = new VirtualList(byId('workers'), {
      label: 'Workers',
      rowHeightProperty: '--worker-row',
      makeRow,
      updateRow,
      keyOf: (worker) => worker.name,
    });
    store.listen('workers', this.draw);
    setInterval(this.draw, AGE_MS);
  }

  private readonly draw = () => {
    const workers = this.store.workers.sorted;
    setText(byId('worker-count'), format.exact(workers.length));
    byId('workers-empty').hidden = workers.length > 0;
    byId('workers').hidden = workers.length === 0;
    this.list.setItems(workers, null);
  };
}

function makeRow(): HTMLElement {
  return el(
      'div', {class: 'worker-row'},
      el('div', {class: 'job-line'}, el('span', {class: 'job-title'}), badge('idle')),
      el('div', {class: 'job-line job-small'}, el('span', {class: 'job-facts'}), el('span')));
}

function updateRow(row: HTMLElement, worker: Worker) {
  const [top, bottom] = [child(row, 0), child(row, 1)];
  const name = format.shortName(worker.name);
  setText(child(top, 0), worker.host && worker.host !== name ? name + ' on ' + worker.host : name);
  row.title = worker.numeric_profile;
  setBadge(child(top, 1), worker.state);
  setText(child(bottom, 0), worker.reason || factsOf(worker));
  setText(child(bottom, 1), 'seen ' + format.ago(worker.last_seen_time));
}

function factsOf(worker: Worker): string {
  const threads = worker.thread_count === 1 ? '1 thread' : worker.thread_count + ' threads';
  const leases = worker.lease_count === 1 ? '1 lease' : worker.lease_count + ' leases';
  return [
    format.count(worker.samples_per_second) + '/s', threads, leases,
    format.exact(worker.result_count) + ' results'
  ].join(' · ');
}
