// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The workers, with what each holds and how fast it is.

import {badge, byId, el, setBadge, setText} from './dom.js';
import * as format from './format.js';
import {VirtualList} from './virtual_list.js';

// "Seen 3 s ago" grows old without an event.
const AGE_MS = 1000;

export class WorkersView {
  constructor(store) {
    this.store = store;
    this.list = new VirtualList(byId('workers'), {
      label: 'Workers',
      rowHeightProperty: '--worker-row',
      makeRow,
      updateRow,
      keyOf: (worker) => worker.name,
    });
    store.listen('workers', this.draw);
    setInterval(this.draw, AGE_MS);
    this.draw();
  }

  draw = () => {
    const workers = [...this.store.workers.values()].sort((a, b) => (a.name < b.name ? -1 : 1));
    setText(byId('worker-count'), format.exact(workers.length));
    byId('workers-empty').hidden = workers.length > 0;
    byId('workers').hidden = workers.length === 0;
    this.list.setItems(workers, null);
  };
}

function makeRow() {
  return el(
      'div', {class: 'worker-row'},
      el('div', {class: 'job-line'}, el('span', {class: 'job-title'}), badge('idle')),
      el('div', {class: 'job-line job-small'}, el('span', {class: 'job-facts'}), el('span')));
}

function updateRow(row, worker) {
  const [top, bottom] = row.children;
  const name = format.shortName(worker.name);
  setText(
      top.firstElementChild,
      worker.host && worker.host !== name ? name + ' on ' + worker.host : name);
  row.title = worker.numeric_profile;
  setBadge(top.lastElementChild, worker.state);
  setText(bottom.firstElementChild, worker.reason || factsOf(worker));
  setText(bottom.lastElementChild, 'seen ' + format.ago(worker.last_seen_time));
}

function factsOf(worker) {
  const threads = worker.thread_count === 1 ? '1 thread' : worker.thread_count + ' threads';
  const leases = worker.lease_count === 1 ? '1 lease' : worker.lease_count + ' leases';
  return [
    format.count(worker.samples_per_second) + '/s', threads, leases,
    format.exact(worker.result_count) + ' results'
  ].join(' · ');
}
