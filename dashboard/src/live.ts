// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Keeps the store up to date: fetches everything once, then follows server-sent events. If the
// stream fails, it polls until the stream is back. A hidden page closes its stream, because a
// browser opens only six connections to one server.

import * as api from './api';
import type {Store} from './store';

// Page size for jobs and workers: small, so that parsing one page is a short task.
const FIRST_PAGE = 100;
const PAGE = 250;
// Maximum number of pages of jobs and workers; older jobs are not listed.
const PAGES_MAX = 80;
const FRAMES_PAGE = 1000;
const POLL_MS = 2000;
const COUNTERS_MS = 3000;
// Events that wait to be read; beyond it everything is fetched again.
const CHANGES_MAX = 10000;
// Time limit for events that are read in one task.
const APPLY_MS_MAX = 8;

type Timer = ReturnType<typeof setInterval>;

export class Live {
  private source: EventSource|null = null;
  private pollTimer: Timer|undefined;
  private counterTimer: Timer|undefined;
  private loading: Promise<boolean>|null = null;
  // Events that are not read yet, in order.
  private changes: (() => void)[] = [];

  constructor(private readonly store: Store) {
    document.addEventListener(
        'visibilitychange', () => document.hidden ? this.stop() : this.start());
    this.start();
  }

  private start() {
    if (this.source || document.hidden) return;
    // Subscribe first and fetch on open: changes in between arrive as events.
    const source = new EventSource(api.eventsPath);
    this.source = source;
    source.onopen = () => this.refresh();
    source.onerror = () => this.onStreamLost();
    const follow = <Type extends {name: string}>(type: string, apply: (object: Type) => void) =>
        source.addEventListener(type, (event: MessageEvent<string>) => {
          this.enqueue(() => {
            const object = JSON.parse(event.data) as Type;
            this.store.answers.noteEvent(object.name);
            apply(object);
          });
        });
    follow<api.Job>('job', (job) => this.store.setJob(job));
    follow<api.Frame>('frame', (frame) => this.store.setFrame(frame));
    follow<api.Worker>('worker', (worker) => this.store.setWorker(worker));
    follow<{name: string}>('job_removed', ({name}) => this.onRemoved(() => {
      if (this.store.jobs.get(name)) this.store.removeJob(name);
    }));
    follow<{name: string}>(
        'worker_removed', ({name}) => this.onRemoved(() => this.store.removeWorker(name)));
    source.addEventListener('reset', () => this.refresh());
    this.counterTimer =
        setInterval(() => this.attempt('loading counters', () => this.loadCounters()), COUNTERS_MS);
  }

  // A load that began before would bring it back.
  private onRemoved(remove: () => void) {
    remove();
    if (this.loading) void this.refresh();
  }

  // The browser hands over all events that arrived at once in one task; they are read in several.
  private enqueue(change: () => void) {
    if (this.changes.length === 0) setTimeout(() => this.applyChanges());
    this.changes.push(change);
    if (this.changes.length <= CHANGES_MAX) return;
    this.changes = this.changes.slice(-1);
    void this.refresh();
  }
  private applyChanges() {
    const end = performance.now() + APPLY_MS_MAX;
    let done = 0;
    while (done < this.changes.length && performance.now() < end) this.changes[done++]?.();
    this.changes.splice(0, done);
    if (this.changes.length > 0) setTimeout(() => this.applyChanges());
  }

  private stop() {
    this.source?.close();
    this.source = null;
    clearInterval(this.pollTimer);
    clearInterval(this.counterTimer);
    this.pollTimer = undefined;
  }

  private onStreamLost() {
    this.store.setConnection('reconnecting');
    // A refused stream (too many readers) stays closed: retry it with the polls.
    if (this.source?.readyState === EventSource.CLOSED) this.source = null;
    this.poll();
  }

  private poll() {
    if (this.pollTimer) return;
    this.pollTimer = setInterval(async () => {
      this.settle(await this.load());
      if (!this.source) {
        clearInterval(this.counterTimer);
        this.start();
      }
    }, POLL_MS);
  }

  // Fetches everything after now. A load that is already running began before the stream existed:
  // it may miss later changes, or fail because the coordinator was away.
  private async refresh() {
    await this.loading;
    this.settle(await this.load());
  }

  // Reports the connection state after a load, and polls until the stream works.
  private settle(loaded: boolean) {
    if (document.hidden) return;
    const streams = this.source?.readyState === EventSource.OPEN;
    this.store.setConnection(!loaded ? 'reconnecting' : streams ? 'live' : 'polling');
    if (!loaded || !streams) return this.poll();
    clearInterval(this.pollTimer);
    this.pollTimer = undefined;
  }

  // One load runs at a time. Returns whether it succeeded.
  private load(): Promise<boolean> {
    this.loading ??= this.attempt('loading the farm', () => this.loadAll()).finally(() => {
      this.loading = null;
    });
    return this.loading;
  }

  // Returns whether `work` succeeded; the page shows the reason of a failure.
  private async attempt(what: string, work: () => Promise<void>): Promise<boolean> {
    try {
      await work();
      this.store.note(what, null);
      return true;
    } catch (failure) {
      this.store.note(what, failure);
      return false;
    }
  }

  private async loadAll() {
    await Promise.all([this.loadJobs(), this.loadWorkers(), this.loadCounters()]);
    await this.loadFrames('');
    this.store.note('loading counters', null);
    this.store.note('loading frames', null);
  }

  private async loadJobs() {
    const names = await namesOf(async (pageSize, token) => {
      const [{jobs, next_page_token}, changed] =
          await this.store.answers.to(() => api.listJobs(pageSize, token));
      for (const job of jobs) if (!changed.has(job.name)) this.store.setJob(job);
      return [jobs, next_page_token];
    });
    this.store.jobs.keepOnly(names);
    this.store.touch('jobs');
  }

  private async loadWorkers() {
    const names = await namesOf(async (pageSize, token) => {
      const [{workers, next_page_token}, changed] =
          await this.store.answers.to(() => api.listWorkers(pageSize, token));
      for (const worker of workers) if (!changed.has(worker.name)) this.store.setWorker(worker);
      return [workers, next_page_token];
    });
    this.store.workers.keepOnly(names);
    this.store.touch('workers');
  }

  private async loadCounters() {
    this.store.setCounters((await api.listCounters()).counters);
  }

  // Fetches the selected job's first frames, or more of them.
  showFrames() {
    void this.attempt('loading frames', () => this.loadFrames(''));
  }
  showMoreFrames() {
    void this.attempt('loading frames', () => this.loadFrames(this.store.framesToken));
  }

  // The first page of the selected job's frames, or the page after `token`.
  private async loadFrames(token: string) {
    const name = this.store.jobName;
    if (!name) return;
    const [job, changed] = await this.store.answers.to(
        () => api.getJob(name, FRAMES_PAGE, token).catch((failure: unknown) => {
          // A restarted coordinator may no longer have the job; everything else is still followed.
          if (failure instanceof api.ApiError && failure.status === 404) return null;
          throw failure;
        }));
    if (name !== this.store.jobName) return;
    this.store.setJobMissing(job === null);
    if (job === null) return;
    for (const frame of job.frames) if (!changed.has(frame.name)) this.store.setFrame(frame);
    this.store.framesToken = job.next_page_token;
    this.store.setEffects(job.effect_costs, job.command);
    this.store.touch('frames');
  }
}

// The names on all pages. `load` fetches one page: its objects and the token of the next.
async function namesOf(
    load: (pageSize: number, token: string) => Promise<[{name: string}[], string]>) {
  const names = new Set<string>();
  let token = '';
  for (let page = 0; page < PAGES_MAX; ++page) {
    const [objects, next] = await load(page === 0 ? FIRST_PAGE : PAGE, token);
    for (const object of objects) names.add(object.name);
    token = next;
    if (!token) break;
  }
  return names;
}
