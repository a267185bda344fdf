// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The failed leases of the selected job: the tile, the reason, and the command that renders it
// again on one machine. Fetched when their number has grown.

import * as api from './api';
import type {Failure, Job} from './api';
import {commandField, copyCommand} from './command_field';
import {byId, el, setText} from './dom';
import * as format from './format';
import type {Store} from './store';

const ATTEMPT = 'loading failures';

export class FailuresView {
  private readonly list = byId('failures');
  // The job and count shown or being fetched.
  private shown = '';
  // The items of the list by what they show.
  private items = new Map<string, Element>();

  constructor(private readonly store: Store) {
    this.list.addEventListener('click', (event) => void this.onClick(event));
    for (const topic of ['jobs', 'selection'] as const) store.listen(topic, this.draw);
  }

  private readonly draw = () => {
    const {job} = this.store;
    const count = job?.failure_count ?? 0;
    byId('failures-section').hidden = count === 0;
    const key = job ? job.name + ' ' + count : '';
    if (key === this.shown) return;
    this.shown = key;
    if (!job || count === 0)
      this.show([]);
    else
      void this.fetch(job, key);
  };

  private async fetch(job: Job, key: string) {
    try {
      const {failures} = await api.listFailures(job.name);
      if (key !== this.shown) return;
      const rest = job.failure_count - failures.length;
      setText(
          byId('failures-heading'),
          rest > 0 ? 'Failures: the last ' + failures.length + ' of ' + job.failure_count :
                     'Failures');
      this.show(failures);
      this.store.note(ATTEMPT, null);
    } catch (failure) {
      // The job's next event tries again.
      if (key === this.shown) this.shown = '';
      this.store.note(ATTEMPT, failure);
    }
  }

  // Items that stay are not moved, so that a focused button keeps the focus.
  private show(failures: Failure[]) {
    const items = new Map<string, Element>();
    for (const failure of failures) {
      const key = JSON.stringify(failure);
      items.set(key, this.items.get(key) ?? makeItem(failure));
    }
    for (const [key, item] of this.items)
      if (!items.has(key)) item.remove();
    let next = this.list.firstElementChild;
    for (const item of items.values()) {
      if (item === next)
        next = item.nextElementSibling;
      else
        this.list.insertBefore(item, next);
    }
    this.items = items;
  }

  private async onClick(event: MouseEvent) {
    const button = (event.target as Element).closest('button');
    if (button) await copyCommand(button);
  }
}

function makeItem(failure: Failure): HTMLElement {
  return el(
      'li', {}, el('p', {class: 'failure-message'}, failure.message || 'no reason was given'),
      el('p', {class: 'job-small'}, whereOf(failure)),
      commandField(failure.command, 'Command that renders the tile again'));
}

function whereOf(failure: Failure): string {
  const range =
      failure.first_sample + ' to ' + (failure.first_sample + failure.sample_count - 1);
  const work = failure.task === 'training' ? 'training' :
      failure.task === 'light'             ? 'light passes ' + range :
      'tile at ' + format.place(failure.tile) + ', samples ' + range;
  return [
    'frame ' + failure.frame_number + ', ' + work,
    failure.kind, 'on ' + format.shortName(failure.worker), format.clock(failure.time)
  ].join(' · ');
}
