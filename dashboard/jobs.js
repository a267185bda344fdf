// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The list of jobs, newest first, with a filter.

import {badge, byId, el, progressBar, setBadge, setProgress, setText} from './dom.js';
import * as format from './format.js';
import {VirtualList} from './virtual_list.js';

export class JobsView {
  constructor(store, select) {
    this.store = store;
    this.list = new VirtualList(byId('jobs'), {
      label: 'Jobs, newest first',
      rowHeightProperty: '--job-row',
      makeRow,
      updateRow,
      keyOf: (job) => job.name,
      onSelect: (job) => select(job.name),
    });
    this.filter = byId('job-filter');
    this.filter.addEventListener('input', () => this.draw());
    for (const topic of ['jobs', 'selection']) store.listen(topic, this.draw);
    this.draw();
  }

  draw = () => {
    const all = [...this.store.jobs.values()];
    all.sort(format.newestFirst);
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
}

const matches = (job, words) =>
    (job.title + ' ' + job.state + ' ' + job.name).toLowerCase().includes(words);

function makeRow() {
  return el(
      'div', {class: 'job-row'},
      el('div', {class: 'job-line'}, el('span', {class: 'job-title'}), badge('queued')),
      progressBar('Progress'),
      el('div', {class: 'job-line job-small'}, el('span', {class: 'job-facts'}), el('span')));
}

function updateRow(row, job) {
  const [top, bar, bottom] = row.children;
  setText(top.firstElementChild, job.title || job.name);
  setBadge(top.lastElementChild, job.state);
  const share = format.doneShare(job.progress);
  setProgress(bar, share, job.state);
  setText(bottom.firstElementChild, factsOf(job, share));
  setText(bottom.lastElementChild, timeOf(job));
}

function factsOf(job, share) {
  const facts = [format.percent(share)];
  if (job.frame_count > 1)
    facts.push(job.frame_complete_count + ' of ' + job.frame_count + ' frames');
  if (job.progress.relative_mse)
    facts.push('error ' + format.typicalError(job.progress.relative_mse));
  return facts.join(' · ');
}

function timeOf(job) {
  const left = job.progress.remaining_duration_seconds;
  if (job.state === 'running' && left !== null) return format.duration(left) + ' left';
  return format.hasEnded(job) ? 'took ' + format.duration(job.progress.wall_duration_seconds) : '';
}
