// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The failed leases of the selected job by task: what failed, a log of who failed it when and why,
// and commands that render it again. Fetched when their number has grown.

import * as api from './api';
import type {Failure, Job} from './api';
import {commandField, copyCommand} from './command_field';
import {byId, el, setText} from './dom';
import * as format from './format';
import type {JobActions} from './job_actions';
import type {Store} from './store';

const ATTEMPT = 'loading failures';

export class FailuresView {
  private readonly list = byId('failures');
  // The job and count shown or being fetched.
  private shown = '';
  // The items of the list by what they show.
  private items = new Map<string, Element>();

  constructor(private readonly store: Store, private readonly actions: JobActions) {
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
    const job = this.store.job;
    for (const [task, ofTask] of byTask(failures)) {
      const key = JSON.stringify([task, ofTask.length, job?.failure]);
      items.set(key, this.items.get(key) ?? makeItem(job, ofTask));
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
    if (!button) return;
    if (button.dataset.act === 'retry')
      this.actions.retry(Number(button.dataset.frame), null);
    else
      await copyCommand(button);
  }
}

// In the order of their last failures, the newest first.
function byTask(failures: readonly Failure[]): Map<string, Failure[]> {
  const tasks = new Map<string, Failure[]>();
  for (const failure of failures) {
    const {frame_number, task, tile, first_sample} = failure;
    const key = [frame_number, task, tile.x0_px, tile.y0_px, first_sample].join();
    tasks.set(key, [...tasks.get(key) ?? [], failure]);
  }
  return tasks;
}

// A message that the head of the job shows is not repeated, and each message of a task stands once.
function makeItem(job: Job|undefined, failures: readonly Failure[]): HTMLElement {
  const [newest] = failures;
  if (!newest) return el('li');
  const messages = new Set(failures.map(({message}) => message || 'no reason was given'));
  if (job?.failure) {
    for (const message of messages)
      if (job.failure.includes(message)) messages.delete(message);
  }
  const frame = newest.frame_number;
  const log =
      el('details', {class: 'failure-log'},
         el('summary', {},
            'Log: ' + (failures.length === 1 ? '1 failure' : failures.length + ' failures')),
         el('pre', {tabindex: '0'}, failures.map(lineOf).join('\n')));
  const retry = job && job.state === 'failed' ?
      [el('button',
          {class: 'button', type: 'button', 'data-act': 'retry', 'data-frame': String(frame)},
          'Retry frame ' + frame)] :
      [];
  return el(
      'li', {}, ...[...messages].map((message) => el('p', {class: 'failure-message'}, message)),
      el('div', {class: 'aside-head'}, el('p', {class: 'job-small'}, whereOf(newest)),
         el('span', {class: 'spread'}), ...retry),
      log,
      commandField(
          `sheaf bundle ${job?.name ?? ''} --frame ${
              frame} -o failed.tar && sheaf repro failed.tar`,
          'Command that renders the failed task again, in any folder'),
      commandField(
          newest.command, 'Command that renders the tile again, in the folder of the scene'));
}

const lineOf = (failure: Failure) => [format.clock(failure.time), format.shortName(failure.worker),
                                      failure.kind, failure.message || 'no reason was given']
                                         .join('  ');

function whereOf(failure: Failure): string {
  const range = failure.first_sample + ' to ' + (failure.first_sample + failure.sample_count - 1);
  const work = failure.task === 'training' ? 'training' :
      failure.task === 'light'             ? 'light passes ' + range :
                                 'tile at ' + format.place(failure.tile) + ', samples ' + range;
  return [
    'frame ' + failure.frame_number + ', ' + work, failure.kind,
    'on ' + format.shortName(failure.worker), format.clock(failure.time)
  ].join(' · ');
}
