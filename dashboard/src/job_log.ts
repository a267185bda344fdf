// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The events of the selected job, oldest first, as sheaf logs prints them. Fetched while their fold
// is open, when the job has changed.

import * as api from './api';
import type {Job, JobEvent} from './api';
import {byId, el} from './dom';
import * as format from './format';
import type {Store} from './store';

const ATTEMPT = 'loading the log';
// A running job changes with each result; its log is fetched at most this often.
const FETCH_MS_MIN = 2000;

export class JobLogView {
  private readonly fold = byId<HTMLDetailsElement>('log');
  private readonly list = byId('log-list');
  // The job and its state that are shown or being fetched.
  private shown = '';
  private timer: number|undefined;

  constructor(private readonly store: Store) {
    this.fold.addEventListener('toggle', this.draw);
    for (const topic of ['jobs', 'selection'] as const) store.listen(topic, this.draw);
  }

  private readonly draw = () => {
    const {job} = this.store;
    if (!job || !this.fold.open) return;
    const key = keyOf(job);
    if (key === this.shown || this.timer !== undefined) return;
    if (!this.shown.startsWith(job.name + ' ')) this.list.replaceChildren();
    this.shown = key;
    void this.fetch(job, key);
    this.timer = window.setTimeout(() => {
      this.timer = undefined;
      this.draw();
    }, FETCH_MS_MIN);
  };

  private async fetch(job: Job, key: string) {
    try {
      const {events} = await api.listEvents(job.name);
      if (key !== this.shown) return;
      this.list.replaceChildren(...events.map(lineOf));
      this.store.note(ATTEMPT, null);
    } catch (failure) {
      if (key === this.shown) this.shown = '';
      this.store.note(ATTEMPT, failure);
    }
  }
}

const keyOf = (job: Job) =>
    [job.name + ' ', job.state, job.failure_count, job.frame_complete_count, job.priority,
     job.pinned, job.incomplete_frame_count, job.progress.sample_count_done > 0]
        .join();

function lineOf(event: JobEvent): HTMLElement {
  const rest = [
    ...event.frame_number === null ? [] : ['frame ' + event.frame_number],
    ...event.who ? [format.shortName(event.who)] : [],
    ...event.text ? [event.text] : [],
  ].join(' · ');
  return el(
      'li', {'data-what': event.what}, el('time', {datetime: event.time}, format.clock(event.time)),
      el('b', {}, event.what), el('span', {}, rest));
}
