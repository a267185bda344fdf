// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What the page knows: the latest object under each name, and what is selected. Views listen to a
// topic and are told at most once per drawn picture, however many events came.

export class Store {
  constructor() {
    this.jobs = new Map();
    this.workers = new Map();
    // Frames of the selected job only.
    this.frames = new Map();
    this.framesToken = '';
    this.counters = [];
    this.jobName = null;
    this.frameName = null;
    // Relative error of the selected job against samples, as seen since it was selected.
    this.errorHistory = [];
    this.connection = 'connecting';
    this.listeners = new Map();
    this.changed = new Set();
  }

  // Topics: jobs, workers, frames, counters, selection, connection.
  listen(topic, listener) {
    if (!this.listeners.has(topic)) this.listeners.set(topic, []);
    this.listeners.get(topic).push(listener);
  }

  touch(topic) {
    if (this.changed.size === 0) requestAnimationFrame(() => this.tell());
    this.changed.add(topic);
  }

  tell() {
    const topics = [...this.changed];
    this.changed.clear();
    const listeners = new Set(topics.flatMap((topic) => this.listeners.get(topic) || []));
    for (const listener of listeners) listener();
  }

  setJob(job) {
    this.jobs.set(job.name, job);
    if (job.name === this.jobName) this.noteError(job);
    this.touch('jobs');
  }

  setFrame(frame) {
    if (!frame.name.startsWith(this.jobName + '/')) return;
    this.frames.set(frame.name, frame);
    this.touch('frames');
  }

  setWorker(worker) {
    this.workers.set(worker.name, worker);
    this.touch('workers');
  }

  setCounters(counters) {
    this.counters = counters;
    this.touch('counters');
  }

  setConnection(connection) {
    if (this.connection === connection) return;
    this.connection = connection;
    this.touch('connection');
  }

  // Forgets what the coordinator no longer lists.
  keepOnly(map, names) {
    for (const name of map.keys())
      if (!names.has(name)) map.delete(name);
  }

  selectJob(name) {
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

  selectFrame(name) {
    if (this.frameName === name) return;
    this.frameName = name;
    this.touch('selection');
  }

  noteError(job) {
    const {sample_count_done: samples, relative_mse: mse} = job.progress;
    const last = this.errorHistory[this.errorHistory.length - 1];
    if (mse > 0 && (!last || samples > last.samples)) this.errorHistory.push({samples, mse});
  }

  get job() {
    return this.jobs.get(this.jobName);
  }

  // The chosen frame, or else the one that shows most life: the first that is begun and not
  // complete, or the last complete one.
  get frame() {
    const chosen = this.frames.get(this.frameName);
    if (chosen) return chosen;
    const frames = [...this.frames.values()];
    return frames.find((frame) => !frame.complete && frame.preview_version > 0) ||
        frames.filter((frame) => frame.complete).pop() || frames[0];
  }
}
