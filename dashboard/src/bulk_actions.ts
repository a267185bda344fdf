// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Actions on all chosen jobs. Each button says on how many of them it acts, as a paused job is not
// paused again. Requests are sent one after another.

import * as api from './api';
import type {Job} from './api';
import {confirm} from './confirm';
import {byId, setText} from './dom';
import * as format from './format';
import type {Store} from './store';

interface Action {
  button: string;
  word: string;
  // "Pausing 3 of 12".
  doing: string;
  applies: (job: Job) => boolean;
  ask: (job: Job) => Promise<Job|null>;
  // The question for actions that cannot be undone.
  question?: (count: string) => {
    title: string;
    text: string;
    no: string
  };
}

const isLive = (job: Job) => !format.hasEnded(job);

const PAUSE: Action = {
  button: 'table-pause',
  word: 'Pause',
  doing: 'Pausing',
  applies: (job) => isLive(job) && job.state !== 'paused',
  ask: (job) => api.pauseJob(job.name),
};
const RESUME: Action = {
  button: 'table-resume',
  word: 'Resume',
  doing: 'Resuming',
  applies: (job) => job.state === 'paused',
  ask: (job) => api.resumeJob(job.name),
};
const RETRY: Action = {
  button: 'table-retry',
  word: 'Retry',
  doing: 'Retrying',
  applies: (job) => job.state === 'failed' || isLive(job) && job.incomplete_frame_count > 0,
  ask: (job) => api.retryTasks(job.name, null, null),
};
const CANCEL: Action = {
  button: 'table-cancel',
  word: 'Cancel',
  doing: 'Cancelling',
  applies: isLive,
  ask: (job) => api.cancelJob(job.name),
  question: (count) => ({
    title: 'Cancel ' + count + '?',
    text: 'Their samples rendered so far are discarded.',
    no: 'Keep rendering',
  }),
};
const DELETE: Action = {
  button: 'table-delete',
  word: 'Delete',
  doing: 'Deleting',
  applies: (job) => format.hasEnded(job) && !job.pinned,
  ask: async (job) => {
    await api.deleteJob(job.name);
    return null;
  },
  question: (count) => ({
    title: 'Delete ' + count + '?',
    text:
        'Their images and all their data are removed from the coordinator. This cannot be undone.',
    no: 'Keep jobs',
  }),
};
const ACTIONS = [PAUSE, RESUME, RETRY, CANCEL, DELETE];

export class BulkActions {
  private readonly priority = byId<HTMLInputElement>('table-priority');
  private busy = false;

  constructor(private readonly store: Store, private readonly chosen: () => Job[]) {
    for (const action of ACTIONS)
      byId(action.button).addEventListener('click', () => void this.start(action));
    byId('table-priority-set').addEventListener('click', () => this.setPriority());
    this.priority.addEventListener('keydown', (event) => {
      if (event.key === 'Enter') this.setPriority();
    });
    this.draw();
  }

  draw() {
    const jobs = this.chosen();
    for (const {button, word, applies, question} of ACTIONS) {
      const count = jobs.filter(applies).length;
      const element = byId<HTMLButtonElement>(button);
      element.disabled = this.busy || count === 0;
      setText(element, word + (count > 0 ? ' ' + count : '') + (question ? '…' : ''));
    }
    const isLiveChosen = jobs.some(isLive);
    this.priority.disabled = this.busy || !isLiveChosen;
    byId<HTMLButtonElement>('table-priority-set').disabled = this.busy || !isLiveChosen;
  }

  private setPriority() {
    const value = this.priority.valueAsNumber;
    if (!Number.isInteger(value) || !this.priority.checkValidity()) return;
    void this.start({
      button: '',
      word: 'Set priority',
      doing: 'Setting the priority of',
      applies: isLive,
      ask: (job) => api.setPriority(job.name, value),
    });
  }

  private async start(action: Action) {
    const jobs = this.chosen().filter(action.applies);
    if (jobs.length === 0 || this.busy) return;
    const count =
        jobs.length === 1 ? '“' + (jobs[0]?.title || jobs[0]?.name) + '”' : jobs.length + ' jobs';
    if (action.question &&
        !await confirm({...action.question(count), yes: action.word + ' ' + count})) {
      return;
    }
    this.busy = true;
    const attempt = action.doing.toLowerCase() + ' jobs';
    this.store.note(attempt, null);
    const failures: string[] = [];
    for (const [i, job] of jobs.entries()) {
      setText(byId('table-doing'), action.doing + ' ' + (i + 1) + ' of ' + jobs.length);
      this.draw();
      try {
        await this.apply(action, job);
      } catch (failure) {
        failures.push(job.name + ': ' + (failure instanceof Error ? failure.message : failure));
      }
    }
    this.busy = false;
    setText(byId('table-doing'), '');
    // One line for each would fill the page; the first says what is wrong.
    if (failures.length > 0) {
      const more = failures.length > 1 ? ' and ' + (failures.length - 1) + ' more' : '';
      this.store.note(attempt, failures[0] + more);
    }
    this.store.touch('jobs');
  }

  private async apply(action: Action, job: Job) {
    const [now, changed] = await this.store.answers.to(() => action.ask(job));
    if (now === null)
      this.store.removeJob(job.name);
    else if (!changed.has(job.name))
      this.store.setJob(now);
  }
}
