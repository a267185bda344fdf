// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What the page knows: the latest object under each name, what is selected, and what went wrong.
// Views listen to a topic and are told at most once per drawn picture, however many events came,
// and a few at a time, so that no task grows long.

import type {Counter, EffectCost, Frame, Job, Worker} from './api';
import {WatchedCurve, curveOfRounds} from './curve';
import type {CurveSource} from './curve';
import {newestFirst} from './format';
import {SortedMap} from './sorted_map';

export type Topic =
    'jobs'|'workers'|'frames'|'effects'|'counters'|'selection'|'beside'|'connection'|'problems';
export type Connection = 'live'|'connecting'|'polling'|'reconnecting';

// Of drawing in one task; what is left is drawn with the next picture.
const TELL_MS_MAX = 8;

// Rounds of a frame that make a curve.
const ROUNDS_MIN = 2;

export class Store {
  readonly jobs = new SortedMap<Job>(newestFirst);
  readonly workers = new SortedMap<Worker>((a, b) => a.name < b.name ? -1 : 1);
  // Frames of the selected job only.
  readonly frames = new SortedMap<Frame>((a, b) => a.frame_number - b.frame_number);
  framesToken = '';
  // Of the selected job's scene.
  effects: readonly EffectCost[] = [];
  // A frame of any job, to be seen beside the shown one.
  beside: Frame|undefined;
  counters: Counter[] = [];
  jobName: string|null = null;
  // Whether the coordinator says that it has no such job.
  jobMissing = false;
  frameName: string|null = null;
  connection: Connection = 'connecting';
  // What could not be done, by what it was: "loading frames" -> "why".
  readonly problems = new Map<string, string>();
  // Those that were dismissed: unseen until the attempt goes well once, or fails in another way.
  private readonly dismissed = new Map<string, string>();
  // Of the selected job, as seen since it was selected.
  private watchedCurve = new WatchedCurve();
  private readonly listeners = new Map<Topic, (() => void)[]>();
  private readonly changed = new Set<Topic>();
  // Those that are to be told yet.
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
  }

  // Notes how an attempt ended: what was wrong, or null where it went well. What somebody asks for
  // notes null before it begins, too: it is seen again that it fails.
  note(attempt: string, failure: unknown) {
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

  // The same ones again change nothing.
  setEffects(effects: readonly EffectCost[]) {
    if (JSON.stringify(effects) === JSON.stringify(this.effects)) return;
    this.effects = effects;
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

  setCounters(counters: Counter[]) {
    this.counters = counters;
    this.touch('counters');
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

  // How the error fell: of the shown frame from its beginning where the coordinator noted that,
  // or else of the selected job since somebody looks.
  get curve(): CurveSource {
    const rounds = this.frame?.rounds ?? [];
    if (rounds.length < ROUNDS_MIN) return this.watchedCurve;
    const noted = curveOfRounds(rounds);
    // Without a rule they are few, and what was seen since goes on from them.
    if (this.frame?.stop?.target_error || this.job?.frame_count !== 1) return noted;
    const last = noted.points.at(-1)?.sampleCount ?? 0;
    const seen = this.watchedCurve.points.filter((point) => point.sampleCount > last);
    return {points: [...noted.points, ...seen]};
  }

  // The error of a pixel, the root of relMSE, at which the shown frame is to end; 0 for none.
  get targetError(): number {
    return Math.sqrt(this.frame?.stop?.target_error ?? 0);
  }

  get job(): Job|undefined {
    return this.jobs.get(this.jobName ?? '');
  }

  // The chosen frame, or else the one that shows most life: the first that is begun and not
  // complete, or the last complete one.
  get frame(): Frame|undefined {
    const chosen = this.frames.get(this.frameName ?? '');
    if (chosen) return chosen;
    const frames = this.frames.sorted;
    return frames.find((frame) => !frame.complete && frame.preview_version > 0) ??
        frames.filter((frame) => frame.complete).at(-1) ?? frames[0];
  }
}
