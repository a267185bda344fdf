// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The owner of the job, and the settings of the shown frame; with the command that
// submitted the job, or one that submits such a frame again.

import type {Frame, Job} from './api';
import {commandField, copyCommand} from './command_field';
import {byId, child, el, setText} from './dom';
import * as format from './format';
import type {Store} from './store';

export class JobSettingsView {
  private shownCommand = '';

  constructor(private readonly store: Store) {
    byId('settings-command').addEventListener('click', (event) => {
      const button = (event.target as Element).closest('button');
      if (button) void copyCommand(button);
    });
    for (const topic of ['jobs', 'frames', 'effects', 'selection'] as const)
      store.listen(topic, this.draw);
  }

  private readonly draw = () => {
    const {job, frame} = this.store;
    if (!job) return;
    setText(byId('job-whose'), whoseOf(job));
    byId('settings').hidden = !frame;
    if (!frame) return;
    const rows = settingsOf(job, frame);
    const list = byId('settings-list');
    if (list.children.length !== rows.length)
      list.replaceChildren(...rows.map(() => el('div', {class: 'fact'}, el('dt'), el('dd'))));
    rows.forEach(([name, value], i) => {
      setText(child(child(list, i), 0), name);
      setText(child(child(list, i), 1), value);
    });
    const command = this.store.command || commandOf(job, frame);
    if (command === this.shownCommand) return;
    this.shownCommand = command;
    byId('settings-command')
        .replaceChildren(commandField(
            command,
            this.store.command ?
                'Command that submitted the job' :
                'Command that submits such a job again, in the folder of the scene'));
  };
}

// "jobs/6 · anna · show film · submitted 07:58:12 · ended 08:01:03".
function whoseOf(job: Job): string {
  return [
    job.name,
    ...job.owner ? [job.owner] : [],
    ...job.show && job.show !== 'default' ? ['show ' + job.show] : [],
    'submitted ' + format.clock(job.create_time),
    ...job.end_time ? ['ended ' + format.clock(job.end_time)] : [],
    ...job.dependencies.map(({job_name, state}) => 'after ' + job_name + ': ' + state),
  ].join(' · ');
}

function settingsOf(job: Job, frame: Frame): [string, string][] {
  const {window, stop} = frame;
  const isCrop = window.x1_px - window.x0_px !== frame.width_px ||
      window.y1_px - window.y0_px !== frame.height_px;
  const rows: [string, string|false][] = [
    ['Size', frame.width_px + ' × ' + frame.height_px],
    ['Crop', isCrop && [window.x0_px, window.y0_px, window.x1_px, window.y1_px].join(', ')],
    [stop.target_error ? 'Samples at most' : 'Samples', format.exact(frame.sample_count)],
    ['Target error', !!stop.target_error && format.typicalError(stop.target_error)],
    ['Time at most', !!stop.time_max_seconds && format.duration(stop.time_max_seconds)],
    ['CPU time at most', !!stop.cpu_max_seconds && format.duration(stop.cpu_max_seconds)],
    ['Techniques', frame.techniques || 'camera'],
    ['Bounces', String(frame.depth_max)],
    ['Seed', String(frame.seed)],
    ['Light samples', frame.light_samples_max > 1 && String(frame.light_samples_max)],
    ['Sensor', frame.sensor || false],
    ['Priority', format.signed(job.priority)],
    ['Pool', job.pool],
    ['Required tags', job.required_tags.join(', ') || false],
    ['Memory at least', !!job.memory_min_bytes && format.bytes(job.memory_min_bytes)],
    ['Deadline', !!job.deadline_time && format.clock(job.deadline_time)],
    ['Numbers', job.numeric_profile],
    ['Scene', frame.scene_digest.slice(0, 12)],
  ];
  return rows.filter((row): row is[string, string] => row[1] !== false && row[1] !== '');
}

// For jobs that came without a command, as those dropped on the page: settings that are the scene's
// own are named, too.
function commandOf(job: Job, frame: Frame): string {
  const {stop} = frame;
  const title = job.title || 'scene.pbrt';
  const words = [
    'sheaf submit',
    /^[\w./-]+$/.test(title) ? title : '\'' + title.replaceAll('\'', '\'\\\'\'') + '\'',
    ...stop.target_error ?
        ['--target-error', Number((100 * Math.sqrt(stop.target_error)).toPrecision(3)) + '%'] :
        ['--samples', frame.sample_count],
    '--max-depth',
    frame.depth_max,
    '--seed',
    frame.seed,
    ...frame.techniques ? ['--techniques', frame.techniques] : [],
    ...job.priority ? ['--priority', job.priority] : [],
    ...job.pool && job.pool !== 'default' ? ['--pool', job.pool] : [],
    ...job.required_tags.flatMap((tag) => ['--require', tag]),
  ];
  return words.join(' ');
}
