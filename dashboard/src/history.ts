// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The farm over days: the processor time and samples of each day by the coordinator's accounts, and
// the queue by the times at which the jobs that are kept were submitted and ended.

import * as api from './api';
import type {Job, UsageRow} from './api';
import {byId, child, el, setText} from './dom';
import * as format from './format';
import type {Store} from './store';

const DAY_MS = 86400 * 1000;
// Maximum time between two requests for the accounts while the view is shown.
const REFRESH_MS = 30 * 1000;
const ATTEMPT = 'loading the accounts';

interface Day {
  name: string;  // "2026-05-04", in UTC, as in the accounts.
  cpuSeconds: number;
  sampleCount: number;
  users: [string, number][];
  submitted: number;
  ended: number;
  failed: number;
  queueMax: number;  // Most jobs at a time that had not ended.
}

export class HistoryView {
  private readonly days = byId<HTMLSelectElement>('history-days');
  private rows: readonly UsageRow[] = [];
  private asked = 0;

  constructor(private readonly store: Store) {
    this.days.addEventListener('change', () => {
      this.asked = 0;
      this.draw();
    });
    for (const topic of ['view', 'jobs'] as const) store.listen(topic, this.draw);
  }

  private readonly draw = () => {
    if (this.store.view !== 'history') return;
    if (Date.now() - this.asked > REFRESH_MS) void this.ask();
    const days = daysOf(Number(this.days.value), this.rows, this.store.jobs.sorted);
    const most = (of: (day: Day) => number) => Math.max(1e-9, ...days.map(of));
    const cpuMax = most((day) => day.cpuSeconds), queueMax = most((day) => day.queueMax);
    const body = byId('history-rows');
    if (body.children.length !== days.length) body.replaceChildren(...days.map(() => makeRow()));
    days.forEach((day, i) => updateRow(child(body, i), day, cpuMax, queueMax));
    const sum = days.reduce((all, day) => all + day.cpuSeconds, 0);
    const samples = days.reduce((all, day) => all + day.sampleCount, 0);
    setText(
        byId('history-sum'),
        format.duration(sum) + ' of processor time, ' + format.count(samples) + ' samples');
  };

  private async ask() {
    this.asked = Date.now();
    try {
      const since = dayName(Date.now() - (Number(this.days.value) - 1) * DAY_MS);
      this.rows = (await api.listUsage(since)).usage;
      this.store.note(ATTEMPT, null);
      this.draw();
    } catch (failure) {
      this.store.note(ATTEMPT, failure);
    }
  }
}

const dayName = (time: number) => new Date(time).toISOString().slice(0, 10);

// The newest first.
function daysOf(count: number, rows: readonly UsageRow[], jobs: readonly Job[]): Day[] {
  const days = new Map<string, Day>();
  const now = Date.now();
  for (let i = 0; i < count; ++i) {
    const name = dayName(now - i * DAY_MS);
    days.set(name, {
      name,
      cpuSeconds: 0,
      sampleCount: 0,
      users: [],
      submitted: 0,
      ended: 0,
      failed: 0,
      queueMax: 0
    });
  }
  for (const {day, user, cpu_seconds, sample_count} of rows) {
    const one = days.get(day ?? '');
    if (!one) continue;
    one.cpuSeconds += cpu_seconds;
    one.sampleCount += sample_count;
    one.users.push([user, cpu_seconds]);
  }
  for (const job of jobs) {
    const begun = days.get(job.create_time.slice(0, 10));
    if (begun) ++begun.submitted;
    const ended = days.get(job.end_time?.slice(0, 10) ?? '');
    if (ended) {
      ++ended.ended;
      if (job.state === 'failed') ++ended.failed;
    }
  }
  addQueue(jobs, days);
  return [...days.values()];
}

// The most jobs at a time that had begun and not ended, on each day.
function addQueue(jobs: readonly Job[], days: ReadonlyMap<string, Day>) {
  const steps: [string, number][] = [];
  for (const {create_time, end_time} of jobs) {
    steps.push([create_time, 1]);
    if (end_time) steps.push([end_time, -1]);
  }
  steps.sort(([a], [b]) => a < b ? -1 : Number(a > b));
  let depth = 0, at = 0;
  for (const day of [...days.values()].reverse()) {
    const end = day.name + 'T24';
    // Jobs of days before the first.
    while (at < steps.length && (steps[at]?.[0] ?? '') < day.name) depth += steps[at++]?.[1] ?? 0;
    day.queueMax = depth;
    while (at < steps.length && (steps[at]?.[0] ?? '') < end) {
      depth += steps[at++]?.[1] ?? 0;
      day.queueMax = Math.max(day.queueMax, depth);
    }
  }
}

function makeRow(): HTMLElement {
  const bar = () =>
      el('td', {class: 'history-bar'}, el('span', {class: 'history-fill', 'aria-hidden': 'true'}),
         el('span'));
  return el(
      'tr', {}, el('th', {scope: 'row'}), bar(), el('td', {class: 'wide'}),
      el('td', {class: 'wide'}), bar(), el('td', {class: 'wide'}), el('td', {class: 'wide'}),
      el('td', {class: 'wide'}));
}

function updateRow(row: HTMLElement, day: Day, cpuMax: number, queueMax: number) {
  const bar = (cell: HTMLElement, share: number, words: string) => {
    child(cell, 0).style.width = (100 * share).toFixed(1) + '%';
    setText(child(cell, 1), words);
  };
  setText(child(row, 0), day.name);
  bar(child(row, 1), day.cpuSeconds / cpuMax, format.duration(day.cpuSeconds));
  setText(child(row, 2), format.count(day.sampleCount));
  day.users.sort(([, a], [, b]) => b - a);
  const users = day.users.slice(0, 3).map(([user, cpu]) => user + ' ' + format.duration(cpu));
  setText(child(row, 3), users.join(', ') + (day.users.length > 3 ? ', …' : ''));
  bar(child(row, 4), day.queueMax / queueMax, format.exact(day.queueMax));
  setText(child(row, 5), format.exact(day.submitted));
  setText(child(row, 6), format.exact(day.ended));
  setText(child(row, 7), format.exact(day.failed));
}
