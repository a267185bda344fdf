// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The page's data: the latest object of each name, the selection, and the problems. Views listen to
// a topic. They are called at most once per animation frame, however many events came, and a few at
// a time, so that no task takes long.

import {Answers} from './answers';
import {UnreachableError} from './api';
import type {Counter, EffectCost, Frame, Job, Worker} from './api';
import {WatchedCurve, curveOfRounds} from './curve';
import type {CurveSource} from './curve';
import {newestFirst} from './format';
import {SortedMap} from './sorted_map';

export type Topic = 'jobs'|'workers'|'frames'|'effects'|'counters'|'selection'|'beside'|
    'connection'|'problems'|'view';
export type FarmViewName = 'image'|'jobs'|'workers'|'history';
export type Connection = 'live'|'connecting'|'polling'|'reconnecting';

// Time limit for listeners in one task; the rest is called in the next animation frame.
const TELL_MS_MAX = 8;

// The attempt that stands for all that are repeated while the coordinator is away.
export const UNREACHABLE = 'reaching the coordinator';
const UNREACHABLE_WORDS = 'The coordinator does not answer; trying again.';
const REPEATED = /^(loading|asking|reading) /;

// Minimum number of rounds of a frame that make a curve.
const ROUNDS_MIN = 2;

// At least 1.
export function pixelsOf(frame: Frame|undefined): number {
  if (!frame) return 1;
  const {x0_px, y0_px, x1_px, y1_px} = frame.window;
  return Math.max(1, (x1_px - x0_px) * (y1_px - y0_px));
}

export class Store {
  readonly jobs = new SortedMap<Job>(newestFirst);
  readonly workers = new SortedMap<Worker>((a, b) => a.name < b.name ? -1 : 1);
  // Frames of the selected job only.
  readonly frames = new SortedMap<Frame>((a, b) => a.frame_number - b.frame_number);
  framesToken = '';
  readonly answers = new Answers();
  // Effects of the selected job's scene.
  effects: readonly EffectCost[] = [];
  // The command that submitted the selected job; '' while it is loaded, and if none was kept.
  command = '';
  // A frame of any job, shown beside the current one.
  beside: Frame|undefined;
  counters: Counter[] = [];
  view: FarmViewName = 'image';
  // The signed-in user's; '' without certificates, where everybody may do everything.
  role = '';
  jobName: string|null = null;
  // Whether the coordinator reports that it has no such job.
  jobMissing = false;
  frameName: string|null = null;
  connection: Connection = 'connecting';
  // Failures by attempt: "loading frames" -> "why".
  readonly problems = new Map<string, string>();
  // Dismissed problems: hidden until the attempt succeeds once or fails in another way.
  private readonly dismissed = new Map<string, string>();
  // Curve of the selected job since it was selected.
  private watchedCurve = new WatchedCurve();
  private readonly listeners = new Map<Topic, (() => void)[]>();
  private readonly changed = new Set<Topic>();
  // Listeners to be called.
  private readonly untold = new Set<() => void>();
  private scheduled = false;

  listen(topic: Topic, listener: () => void) {
    this.listeners.set(topic, [...this.listeners.get(topic) ?? [], listener]);
  }

  touch(topic: Topic) {
    this.changed.add(topic);
    this.schedule();
  }

  private schedule() {
    if (this.scheduled) return;
    this.scheduled = true;
    document.documentElement.dataset.drawing = '';  // Some views do not show the data yet.
    requestAnimationFrame(() => this.tell());
  }

  private tell() {
    this.scheduled = false;
    for (const topic of this.changed) {
      for (const listener of this.listeners.get(topic) ?? []) this.untold.add(listener);
    }
    this.changed.clear();
    const end = performance.now() + TELL_MS_MAX;
    for (const listener of this.untold) {
      this.untold.delete(listener);
      listener();
      if (performance.now() > end) break;
    }
    if (this.untold.size > 0) this.schedule();
    if (!this.scheduled) delete document.documentElement.dataset.drawing;
  }

  // Records the result of an attempt: the failure, or null for success. Attempts that the user
  // starts also record null before they begin, so that a repeated failure is shown again.
  note(attempt: string, failure: unknown): void {
    // Everything that is repeated fails alike while the coordinator is away: that is one problem.
    if (failure instanceof UnreachableError && REPEATED.test(attempt))
      return this.note(UNREACHABLE, UNREACHABLE_WORDS);
    if (failure === null && attempt !== UNREACHABLE && REPEATED.test(attempt))
      this.note(UNREACHABLE, null);
    const words = failure instanceof Error ? failure.message : failure === null ? '' : `${failure}`;
    if (words && this.dismissed.get(attempt) === words) return;
    this.dismissed.delete(attempt);
    if ((this.problems.get(attempt) ?? '') === words) return;
    if (words)
      this.problems.set(attempt, words);
    else
      this.problems.delete(attempt);
    this.touch('problems');
  }

  dismissProblems() {
    for (const [attempt, words] of this.problems) this.dismissed.set(attempt, words);
    this.problems.clear();
    this.touch('problems');
  }

  setJob(job: Job) {
    this.jobs.set(job);
    if (job.name === this.jobName) this.watchedCurve.add(job.progress);
    this.touch('jobs');
  }

  // The next job of the list is selected, if it was this one.
  removeJob(name: string) {
    const others = this.jobs.sorted.filter((job) => job.name !== name);
    const at = this.jobs.sorted.findIndex((job) => job.name === name);
    this.jobs.keepOnly(new Set(others.map((job) => job.name)));
    if (this.beside?.name.startsWith(name + '/')) this.setBeside(undefined);
    const next = others[Math.min(at, others.length - 1)];
    if (this.jobName === name) this.selectJob(next?.name ?? '');
    this.touch('jobs');
  }

  setJobMissing(missing: boolean) {
    if (this.jobMissing === missing) return;
    this.jobMissing = missing;
    this.touch('selection');
  }

  setFrame(frame: Frame) {
    if (frame.name === this.beside?.name) this.setBeside(frame);
    if (!frame.name.startsWith(this.jobName + '/')) return;
    this.frames.set(frame);
    this.touch('frames');
  }

  // Setting the same effects again changes nothing.
  setEffects(effects: readonly EffectCost[], command = '') {
    const isSame = command === this.command;
    if (isSame && JSON.stringify(effects) === JSON.stringify(this.effects)) return;
    this.effects = effects;
    this.command = command;
    this.touch('effects');
  }

  setBeside(frame: Frame|undefined) {
    this.beside = frame;
    this.touch('beside');
  }

  setWorker(worker: Worker) {
    this.workers.set(worker);
    this.touch('workers');
  }

  removeWorker(name: string) {
    const others = this.workers.sorted.filter((worker) => worker.name !== name);
    this.workers.keepOnly(new Set(others.map((worker) => worker.name)));
    this.touch('workers');
  }

  setCounters(counters: Counter[]) {
    this.counters = counters;
    this.touch('counters');
  }

  setView(view: FarmViewName) {
    if (this.view === view) return;
    this.view = view;
    this.touch('view');
  }

  setConnection(connection: Connection) {
    if (this.connection === connection) return;
    this.connection = connection;
    this.touch('connection');
  }

  selectJob(name: string) {
    if (this.jobName === name) return;
    this.jobName = name;
    this.jobMissing = false;
    this.frameName = null;
    this.frames.keepOnly(new Set());
    this.framesToken = '';
    this.setEffects([]);
    this.watchedCurve = new WatchedCurve();
    if (this.job) this.watchedCurve.add(this.job.progress);
    this.touch('selection');
    this.touch('frames');
  }

  selectFrame(name: string|null) {
    if (this.frameName === name) return;
    this.frameName = name;
    this.touch('selection');
  }

  // The error over time: from the rounds of the shown frame if the coordinator recorded them,
  // otherwise from the progress of the selected job since the page was opened.
  get curve(): CurveSource {
    const rounds = this.frame?.rounds ?? [];
    if (rounds.length < ROUNDS_MIN) return this.watchedCurve;
    const noted = curveOfRounds(rounds);
    // Without a target error there are few rounds, and the observed progress extends them.
    if (this.frame?.stop.target_error || this.job?.frame_count !== 1) return noted;
    const last = noted.points.at(-1)?.sampleCount ?? 0;
    const seen = this.watchedCurve.points.filter((point) => point.sampleCount > last);
    return {points: [...noted.points, ...seen]};
  }

  // The curve of the compared frame, or the end of it; null where nothing is compared.
  get besideCurve(): CurveSource|null {
    const {beside} = this;
    if (!beside || beside.name === this.frame?.name) return null;
    const noted = curveOfRounds(beside.rounds);
    if (noted.points.length > 0) return noted;
    const only = new WatchedCurve();
    only.add(beside.progress);
    const job = this.jobs.get(beside.name.replace(/\/frames\/.*/, ''));
    if (job?.frame_count === 1) only.add(job.progress);
    return only;
  }

  // Pixels that the points of the curve count samples of.
  get curvePixels(): number {
    const rounds = this.frame?.rounds ?? [];
    const frames = rounds.length < ROUNDS_MIN ? this.job?.frame_count ?? 1 : 1;
    return pixelsOf(this.frame) * frames;
  }

  // The target error of a pixel for the shown frame, the root of its relMSE; 0 for none.
  get targetError(): number {
    return Math.sqrt(this.frame?.stop.target_error ?? 0);
  }

  get job(): Job|undefined {
    return this.jobs.get(this.jobName ?? '');
  }

  // The chosen frame or, by default, the most active one: the first that has begun and is not
  // complete, otherwise the last complete one.
  get frame(): Frame|undefined {
    const chosen = this.frames.get(this.frameName ?? '');
    if (chosen) return chosen;
    const frames = this.frames.sorted;
    return frames.find((frame) => !frame.complete && frame.preview_version > 0) ??
        frames.filter((frame) => frame.complete).at(-1) ?? frames[0];
  }
}
