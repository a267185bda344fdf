// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Keeps the store up to date: fetches everything once, then follows server-sent events. Where the
// stream fails it polls until the stream is back. A hidden page lets go of its stream, because a
// browser holds only six connections to one server.

import * as api from './api.js';

const FIRST_PAGE = 100;
const PAGE = 1000;
// Pages of jobs fetched at most; older jobs are not listed.
const PAGES_MAX = 20;
const POLL_MS = 2000;
const COUNTERS_MS = 3000;

export class Live {
  constructor(store) {
    this.store = store;
    this.source = null;
    this.pollTimer = null;
    this.loading = null;
    document.addEventListener(
        'visibilitychange', () => document.hidden ? this.stop() : this.start());
    this.start();
  }

  start() {
    if (this.source || document.hidden) return;
    // Subscribe first and fetch on open: what changes in between arrives as an event.
    this.source = new EventSource(api.eventsPath);
    this.source.onopen = () => this.refresh();
    this.source.onerror = () => this.onStreamLost();
    const follow = (type, apply) =>
        this.source.addEventListener(type, (event) => apply(JSON.parse(event.data)));
    follow('job', (job) => this.store.setJob(job));
    follow('frame', (frame) => this.store.setFrame(frame));
    follow('worker', (worker) => this.store.setWorker(worker));
    follow('reset', () => this.refresh());
    this.counterTimer = setInterval(() => this.loadCounters().catch(() => {}), COUNTERS_MS);
  }

  stop() {
    if (this.source) this.source.close();
    this.source = null;
    clearInterval(this.pollTimer);
    clearInterval(this.counterTimer);
    this.pollTimer = null;
  }

  onStreamLost() {
    this.store.setConnection('reconnecting');
    // A refused stream (too many readers) is closed for good: try again along with the polls.
    if (this.source && this.source.readyState === EventSource.CLOSED) this.source = null;
    this.poll();
  }

  poll() {
    if (this.pollTimer) return;
    this.pollTimer = setInterval(async () => {
      this.settle(await this.load());
      if (!this.source) {
        clearInterval(this.counterTimer);
        this.start();
      }
    }, POLL_MS);
  }

  // Fetches everything from now on. A load that is under way began before the stream was there: it
  // may miss what changed since, or fail because the coordinator was away.
  async refresh() {
    await this.loading;
    this.settle(await this.load());
  }

  // Says how things stand after a load, and polls until they stand well.
  settle(loaded) {
    if (document.hidden) return;
    const streams = this.source && this.source.readyState === EventSource.OPEN;
    this.store.setConnection(!loaded ? 'reconnecting' : streams ? 'live' : 'polling');
    if (!loaded || !streams) return this.poll();
    clearInterval(this.pollTimer);
    this.pollTimer = null;
  }

  // One load at a time; returns whether it succeeded.
  load() {
    if (!this.loading) {
      this.loading = this.loadAll().then(() => true, () => false).finally(() => {
        this.loading = null;
      });
    }
    return this.loading;
  }

  async loadAll() {
    await Promise.all([this.loadJobs(), this.loadWorkers(), this.loadCounters()]);
    await this.loadFrames();
  }

  async loadJobs() {
    const names = new Set();
    let token = '';
    for (let page = 0; page < PAGES_MAX; ++page) {
      const list = await api.listJobs(page === 0 ? FIRST_PAGE : PAGE, token);
      for (const job of list.jobs) {
        names.add(job.name);
        this.store.setJob(job);
      }
      token = list.next_page_token;
      if (!token) break;
    }
    this.store.keepOnly(this.store.jobs, names);
    this.store.touch('jobs');
  }

  async loadWorkers() {
    const list = await api.listWorkers();
    for (const worker of list.workers) this.store.setWorker(worker);
    this.store.keepOnly(this.store.workers, new Set(list.workers.map((worker) => worker.name)));
    this.store.touch('workers');
  }

  async loadCounters() {
    this.store.setCounters((await api.listCounters()).counters);
  }

  // The first page of the selected job's frames, or the page after `token`.
  async loadFrames(token = '') {
    const name = this.store.jobName;
    if (!name) return;
    const job = await api.getJob(name, PAGE, token).catch((error) => {
      // The coordinator may have come back without it; everything else is to be followed still.
      if (error.status === 404) return null;
      throw error;
    });
    if (job === null) return;
    if (name !== this.store.jobName) return;
    for (const frame of job.frames) this.store.setFrame(frame);
    this.store.framesToken = job.next_page_token;
    this.store.touch('frames');
  }
}
