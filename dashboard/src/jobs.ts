// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The list of jobs, newest first, with thumbnails and a filter.

import type {Job} from './api';
import {badge, byId, child, el, progressBar, setBadge, setProgress, setText} from './dom';
import * as format from './format';
import type {Store} from './store';
import {Thumbnails} from './thumbnails';
import {VirtualList} from './virtual_list';

export class JobsView {
  private readonly list: VirtualList<Job>;
  private readonly thumbnails = new Thumbnails();
  private readonly filter = byId<HTMLInputElement>('job-filter');

  constructor(private readonly store: Store, select: (name: string) => void) {
    this.list = new VirtualList(byId('jobs'), {
      label: 'Jobs, newest first',
      rowHeightProperty: '--job-row',
      makeRow,
      updateRow: (row, job) => this.updateRow(row, job),
      keyOf: (job) => job.name,
      onSelect: (job) => select(job.name),
    });
    this.filter.addEventListener('input', () => this.draw());
    for (const topic of ['jobs', 'selection'] as const) store.listen(topic, this.draw);
  }

  private readonly draw = () => {
    const all = this.store.jobs.sorted;
    const words = this.filter.value.trim().toLowerCase();
    const shown = words ? all.filter((job) => matches(job, words)) : all;
    setText(
        byId('job-count'), words ? shown.length + ' of ' + all.length : format.exact(all.length));
    byId('jobs-empty').hidden = shown.length > 0;
    setText(
        byId('jobs-empty'),
        all.length ? 'No job matches.' : 'No jobs yet. Submit one with: sheaf submit scene.pbrt');
    byId('jobs').hidden = shown.length === 0;
    this.list.setItems(shown, this.store.jobName);
  };

  private updateRow(row: HTMLElement, job: Job) {
    this.thumbnails.show(child(child(row, 0), 0) as HTMLImageElement, job.preview_frame);
    const words = child(row, 1);
    const [top, bar, bottom] = [child(words, 0), child(words, 1), child(words, 2)];
    setText(child(top, 0), job.title || job.name);
    setBadge(child(top, 1), job.state);
    const share = format.doneShare(job.progress);
    setProgress(bar, share, job.state);
    setText(child(bottom, 0), factsOf(job, share));
    setText(child(bottom, 1), timeOf(job));
  }
}

const matches = (job: Job, words: string) =>
    (job.title + ' ' + job.state + ' ' + job.name).toLowerCase().includes(words);

function makeRow(): HTMLElement {
  return el(
      'div', {class: 'job-row'}, el('div', {class: 'job-image'}, Thumbnails.make()),
      el('div', {class: 'job-words'},
         el('div', {class: 'job-line'}, el('span', {class: 'job-title'}), badge('queued')),
         progressBar('Progress'),
         el('div', {class: 'job-line job-small'}, el('span', {class: 'job-facts'}), el('span'))));
}

function factsOf(job: Job, share: number): string {
  const facts = [format.percent(share)];
  if (job.frame_count > 1)
    facts.push(job.frame_complete_count + ' of ' + job.frame_count + ' frames');
  if (job.progress.relative_mse)
    facts.push('error ' + format.typicalError(job.progress.relative_mse));
  return facts.join(' · ');
}

function timeOf(job: Job): string {
  const left = job.progress.remaining_duration_seconds;
  if (job.state === 'running' && left !== null) return format.duration(left) + ' left';
  if (job.priority !== 0 && !format.hasEnded(job)) return 'priority ' + format.signed(job.priority);
  return format.hasEnded(job) ? 'took ' + format.duration(job.progress.wall_duration_seconds) : '';
}
