// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The list of jobs, newest first, with thumbnails and filters by state and by words.

import type {Job} from './api';
import {badge, byId, child, el, progressBar, setBadge, setProgress, setText} from './dom';
import * as format from './format';
import {filterJobs} from './job_filter';
import type {Store} from './store';
import {Thumbnails} from './thumbnails';
import {VirtualList} from './virtual_list';

export class JobsView {
  private readonly list: VirtualList<Job>;
  private readonly thumbnails = new Thumbnails();
  private readonly filter = byId<HTMLInputElement>('job-filter');
  private readonly state = byId<HTMLSelectElement>('job-state-filter');

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
    this.state.addEventListener('change', () => this.draw());
    for (const topic of ['jobs', 'selection', 'view'] as const) store.listen(topic, this.draw);
  }

  private readonly draw = () => {
    if (this.store.view !== 'image') return;
    const all = this.store.jobs.sorted;
    const shown = filterJobs(all, this.state.value, this.filter.value);
    const isFiltered = this.filter.value.trim() !== '' || this.state.value !== '';
    setText(
        byId('job-count'),
        isFiltered ? shown.length + ' of ' + all.length : format.exact(all.length));
    byId('jobs-empty').hidden = shown.length > 0;
    setText(byId('jobs-empty'), all.length ? 'No job matches.' : 'No jobs yet.');
    byId('jobs').hidden = shown.length === 0;
    this.list.setItems(shown, this.store.jobName);
  };

  private updateRow(row: HTMLElement, job: Job) {
    this.thumbnails.show(child(child(row, 0), 0) as HTMLImageElement, job.preview_frame);
    const words = child(row, 1);
    const [title, bottom, bar] = [child(words, 0), child(words, 1), child(words, 2)];
    setText(child(title, 0), job.title || job.name);
    setText(child(title, 1), format.shortName(job.name) + (job.owner ? ' · ' + job.owner : ''));
    const share = format.doneShare(job.progress);
    setBadge(child(bottom, 0), job.state);
    setText(child(bottom, 1), factsOf(job, share));
    setText(child(bottom, 2), timeOf(job));
    setProgress(bar, share, job.state);
    const more = whoseOf(job);
    if (row.title !== more) row.title = more;
  }
}

// "turntable\njobs/7 of anna, show film".
function whoseOf(job: Job): string {
  const owner = job.owner ? ' of ' + job.owner : '';
  return job.title + '\n' + job.name + owner + (job.show ? ', show ' + job.show : '');
}

function makeRow(): HTMLElement {
  return el(
      'div', {class: 'job-row'}, el('div', {class: 'job-image'}, Thumbnails.make()),
      el('div', {class: 'job-words'},
         el('div', {class: 'job-line'}, el('span', {class: 'job-title'}),
            el('span', {class: 'job-whose job-small'})),
         el('div', {class: 'job-line job-small'}, badge('queued'), el('span', {class: 'job-facts'}),
            el('span')),
         progressBar('Progress')));
}

function factsOf(job: Job, share: number): string {
  if (job.state === 'queued' && job.waiting_reason) return job.waiting_reason;
  const facts = job.state === 'succeeded' ? [] : [format.percent(share)];
  if (job.frame_count > 1)
    facts.push(job.frame_complete_count + ' of ' + job.frame_count + ' frames');
  if (job.progress.relative_mse) facts.push(format.typicalError(job.progress.relative_mse));
  return facts.join(' · ');
}

function timeOf(job: Job): string {
  const left = job.progress.remaining_duration_seconds;
  if (job.state === 'running' && left !== null) return format.duration(left) + ' left';
  if (job.priority !== 0 && !format.hasEnded(job)) return 'priority ' + format.signed(job.priority);
  return format.hasEnded(job) ? 'took ' + format.duration(job.progress.wall_duration_seconds) : '';
}
