// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Chooses the job and frame to show beside the current one. The list of jobs is fetched when the
// user opens it, because it changes all the time.

import * as api from './api';
import type {Frame} from './api';
import {byId, el} from './dom';
import type {Store} from './store';

// Limits of the lists: jobs, and frames of one job.
const JOBS_MAX = 200;
const FRAMES_MAX = 1000;
const ATTEMPT = 'loading the compared frame';

export class CompareChoice {
  private readonly jobs = byId<HTMLSelectElement>('beside-job');
  private readonly numbers = byId<HTMLSelectElement>('beside-frame');
  private frames: Frame[] = [];

  constructor(private readonly store: Store) {
    for (const event of ['focus', 'pointerdown'] as const) {
      this.jobs.addEventListener(event, () => this.listJobs());
    }
    this.jobs.addEventListener('change', () => void this.chooseJob(this.jobs.value));
    this.numbers.addEventListener('change', () => {
      store.setBeside(this.frames.find((frame) => frame.name === this.numbers.value));
    });
    // Events may have been missed.
    store.listen('connection', () => void this.refresh());
    this.jobs.replaceChildren(el('option', {value: ''}, 'nothing'));
  }

  draw() {
    const {beside} = this.store;
    this.numbers.hidden = !beside || this.frames.length < 2;
    if (!beside) this.jobs.value = '';
  }

  private listJobs() {
    const {value} = this.jobs;
    const jobs = this.store.jobs.sorted.slice(0, JOBS_MAX);
    const chosen = this.store.jobs.get(value);
    if (chosen && !jobs.includes(chosen)) jobs.push(chosen);
    this.jobs.replaceChildren(
        el('option', {value: ''}, 'nothing'),
        ...jobs.map(
            (job) =>
                el('option', {value: job.name}, (job.title || job.name) + ' (' + job.name + ')')));
    this.jobs.value = value;
  }

  private async chooseJob(name: string) {
    if (!name) return this.store.setBeside(undefined);
    this.store.note(ATTEMPT, null);
    try {
      const job = await api.getJob(name, FRAMES_MAX, '');
      if (this.jobs.value !== name) return;
      this.frames = job.frames;
      this.numbers.replaceChildren(...job.frames.map(
          (frame) => el('option', {value: frame.name}, 'frame ' + frame.frame_number)));
      // Prefer the shown frame's number, in case the job is another version of the same shot.
      const number = this.store.frame?.frame_number;
      const frame = job.frames.find((one) => one.frame_number === number) ?? job.frames[0];
      if (frame) this.numbers.value = frame.name;
      this.store.setBeside(frame);
    } catch (failure) {
      this.store.note(ATTEMPT, failure);
    }
  }

  private async refresh() {
    const name = this.store.beside?.name;
    if (!name || this.store.connection !== 'live') return;
    try {
      const frame = await api.getFrame(name);
      if (this.store.beside?.name === name) this.store.setBeside(frame);
    } catch {
      // The frame may have been lost with an earlier coordinator.
      if (this.store.beside?.name === name) this.store.setBeside(undefined);
    }
  }
}
