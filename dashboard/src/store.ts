// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What the page knows: the latest object under each name, what is selected, and what went wrong.
// Views listen to a topic and are told at most once per drawn picture, however many events came.

import type {Counter, Frame, Job, Worker} from './api';

export type Topic = 'jobs'|'workers'|'frames'|'counters'|'selection'|'connection'|'problems';
export type Connection = 'live'|'connecting'|'polling'|'reconnecting';

export class Store {
  readonly jobs = new Map<string, Job>();
  readonly workers = new Map<string, Worker>();
  // Frames of the selected job only.
  readonly frames = new Map<string, Frame>();
  framesToken = '';
  counters: Counter[] = [];
  jobName: string|null = null;
  frameName: string|null = null;
  connection: Connection = 'connecting';
  // What could not be done, by what it was: "loading frames" -> "why".
  readonly problems = new Map<string, string>();
  // Relative error of the selected job against samples, as seen since it was selected.
  errorHistory: {samples: number; mse: number}[] = [];
  private readonly listeners = new Map<Topic, (() => void)[]>();
  private readonly changed = new Set<Topic>();

  listen(topic: Topic, listener: () => void) {
    this.listeners.set(topic, [...this.listeners.get(topic) ?? [], listener]);
  }

  touch(topic: Topic) {
    if (this.changed.size === 0) requestAnimationFrame(() => this.tell());
    this.changed.add(topic);
  }

  private tell() {
    const topics = [...this.changed];
    this.changed.clear();
    for (const listener of new Set(topics.flatMap((topic) => this.listeners.get(topic) ?? []))) {
      listener();
    }
  }

  // Notes how an attempt ended: what was wrong, or null where it went well.
  note(attempt: string, failure: unknown) {
    const words = failure instanceof Error ? failure.message : failure === null ? '' : `${failure}`;
    if ((this.problems.get(attempt) ?? '') === words) return;
    if (words)
      this.problems.set(attempt, words);
    else
      this.problems.delete(attempt);
    this.touch('problems');
  }

  setJob(job: Job) {
    this.jobs.set(job.name, job);
    if (job.name === this.jobName) this.noteError(job);
    this.touch('jobs');
  }

  setFrame(frame: Frame) {
    if (!frame.name.startsWith(this.jobName + '/')) return;
    this.frames.set(frame.name, frame);
    this.touch('frames');
  }

  setWorker(worker: Worker) {
    this.workers.set(worker.name, worker);
    this.touch('workers');
  }

  setCounters(counters: Counter[]) {
    this.counters = counters;
    this.touch('counters');
  }

  setConnection(connection: Connection) {
    if (this.connection === connection) return;
    this.connection = connection;
    this.touch('connection');
  }

  // Forgets what the coordinator no longer lists.
  keepOnly(map: Map<string, unknown>, names: Set<string>) {
    for (const name of map.keys()) {
      if (!names.has(name)) map.delete(name);
    }
  }

  selectJob(name: string) {
    if (this.jobName === name) return;
    this.jobName = name;
    this.frameName = null;
    this.frames.clear();
    this.framesToken = '';
    this.errorHistory = [];
    if (this.job) this.noteError(this.job);
    this.touch('selection');
    this.touch('frames');
  }

  selectFrame(name: string|null) {
    if (this.frameName === name) return;
    this.frameName = name;
    this.touch('selection');
  }

  private noteError(job: Job) {
    const {sample_count_done: samples, relative_mse: mse} = job.progress;
    const last = this.errorHistory.at(-1);
    if (mse && (!last || samples > last.samples)) this.errorHistory.push({samples, mse});
  }

  get job(): Job|undefined {
    return this.jobs.get(this.jobName ?? '');
  }

  // The chosen frame, or else the one that shows most life: the first that is begun and not
  // complete, or the last complete one.
  get frame(): Frame|undefined {
    const chosen = this.frames.get(this.frameName ?? '');
    if (chosen) return chosen;
    const frames = [...this.frames.values()];
    return frames.find((frame) => !frame.complete && frame.preview_version > 0) ??
        frames.filter((frame) => frame.complete).pop() ?? frames[0];
  }
}
