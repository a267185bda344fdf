// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Actions on the selected job: pause, resume, set its priority, approve its frames, cancel, refine
// it when it is finished, try its failed work again, give up a frame, and delete it.

import * as api from './api';
import type {Frame, Job} from './api';
import {confirm} from './confirm';
import {byId, setText} from './dom';
import * as format from './format';
import {RefineDialog} from './refine_dialog';
import type {Store} from './store';

export class JobActions {
  private readonly refineDialog = new RefineDialog();
  private readonly priority = byId<HTMLInputElement>('priority');
  // Resolves after the latest request. Requests are sent one at a time, so that the last one takes
  // effect last.
  private turn = Promise.resolve();
  // Number of requests without a reply.
  private asked = 0;

  constructor(private readonly store: Store) {
    byId('pause').addEventListener('click', () => this.pauseOrResume());
    byId('approve').addEventListener('click', () => this.approve());
    byId('cancel').addEventListener('click', () => this.cancel());
    byId('delete').addEventListener('click', () => this.delete());
    byId('refine').addEventListener('click', () => this.refine());
    byId('retry').addEventListener('click', () => this.retry(null, null));
    byId('kill-frame').addEventListener('click', () => this.killShownFrame());
    this.priority.addEventListener('change', () => this.setPriority());
    // Restores the priority if typed text was not submitted.
    this.priority.addEventListener('blur', this.draw);
    for (const topic of ['jobs', 'frames', 'selection'] as const) store.listen(topic, this.draw);
  }

  private readonly draw = () => {
    const {job, frame} = this.store;
    const ended = !job || format.hasEnded(job);
    byId('retry').hidden = !job || !mayRetry(job, this.store.frames.sorted);
    byId('kill-frame').hidden = ended || !frame || job.frame_count < 2 || !mayKill(frame);
    for (const id of ['priority-box', 'pause', 'cancel']) byId(id).hidden = ended;
    byId('approve').hidden = ended || !job.unapproved_frame_count;
    byId('refine').hidden = job?.state !== 'succeeded' || !job.progress.relative_mse;
    byId('delete').hidden = !job || !ended;
    byId<HTMLButtonElement>('delete').disabled = job?.pinned ?? false;
    if (!job) return;
    setText(byId('pause'), job.state === 'paused' ? 'Resume job' : 'Pause job');
    const isTyped =
        document.activeElement === this.priority && this.priority.dataset.job === job.name;
    if (isTyped || this.asked > 0) return;
    this.priority.value = String(job.priority);
    this.priority.dataset.job = job.name;
  };

  private pauseOrResume() {
    const {job} = this.store;
    if (!job) return;
    if (job.state === 'paused')
      void this.act('resuming', job, () => api.resumeJob(job.name));
    else
      void this.act('pausing', job, () => api.pauseJob(job.name));
  }

  private approve() {
    const {job} = this.store;
    if (job) void this.act('approving', job, () => api.approveFrames(job.name));
  }

  private setPriority() {
    const {job} = this.store;
    const value = this.priority.valueAsNumber;
    if (!job || !Number.isInteger(value) || !this.priority.checkValidity()) return;
    void this.act('setting the priority of', job, () => api.setPriority(job.name, value));
  }

  private async cancel() {
    const {job} = this.store;
    if (!job) return;
    const sure = await confirm({
      title: 'Cancel “' + titleOf(job) + '”?',
      text: 'Its workers continue with other jobs, and the samples rendered so far are discarded.',
      no: 'Keep rendering',
      yes: 'Cancel job',
    });
    if (sure) await this.act('cancelling', job, () => api.cancelJob(job.name));
  }

  private async delete() {
    const {job} = this.store;
    if (!job) return;
    const sure = await confirm({
      title: 'Delete “' + titleOf(job) + '”?',
      text: 'Its images and all its data are removed from the coordinator. This cannot ' +
          'be undone.',
      no: 'Keep job',
      yes: 'Delete job',
    });
    if (!sure) return;
    const attempt = 'deleting “' + titleOf(job) + '”';
    this.store.note(attempt, null);
    try {
      await api.deleteJob(job.name);
      this.store.removeJob(job.name);
    } catch (failure) {
      this.store.note(attempt, failure);
    }
  }

  private async refine() {
    const {job} = this.store;
    if (!job) return;
    const target = await this.refineDialog.ask(job);
    if (target !== null) await this.act('refining', job, () => api.refineJob(job.name, target));
  }

  // All failed work of the selected job, of a frame, or of a task of it.
  retry(frame: number|null, task: number|null) {
    const {job} = this.store;
    if (!job) return;
    const what = (task === null ? '' : 'task ' + task + ' of ') +
        (frame === null ? '' : 'frame ' + frame + ' of ');
    void this.act('retrying ' + what, job, () => api.retryTasks(job.name, frame, task));
  }

  private async killShownFrame() {
    const {frame} = this.store;
    if (frame) await this.killFrame(frame.frame_number);
  }

  async killFrame(frame: number) {
    const {job} = this.store;
    if (!job) return;
    const sure = await confirm({
      title: 'Give up frame ' + frame + '?',
      text: 'It gets no image, and the job fails when its other frames are done. “Retry frame” ' +
          'undoes this.',
      no: 'Keep rendering',
      yes: 'Give up frame',
    });
    if (sure) await this.act('giving up a frame of', job, () => api.killFrame(job.name, frame));
  }

  private act(what: string, job: Job, ask: () => Promise<Job>): Promise<void> {
    this.asked += 1;
    this.turn = this.turn.then(() => this.finish(what + ' “' + titleOf(job) + '”', ask));
    return this.turn;
  }

  private async finish(attempt: string, ask: () => Promise<Job>) {
    this.store.note(attempt, null);
    try {
      const [job, changed] = await this.store.answers.to(ask);
      if (!changed.has(job.name)) this.store.setJob(job);
    } catch (failure) {
      this.store.note(attempt, failure);
    }
    this.asked -= 1;
    this.store.touch('jobs');
  }
}

const titleOf = (job: Job) => job.title || job.name;

const mayKill = (frame: Frame) => !frame.complete && !frame.incomplete;

// Whether the job, or a frame of it, has failed permanently.
function mayRetry(job: Job, frames: readonly Frame[]): boolean {
  if (job.state === 'succeeded' || job.state === 'cancelled') return false;
  return job.state === 'failed' || job.incomplete_frame_count > 0 ||
      frames.some((frame) => frame.set_aside_task_count > 0);
}
