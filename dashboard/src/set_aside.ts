// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The tasks of the selected job that are set aside: for each frame its tasks, the workers that
// failed them and how, the command that reproduces a failure, and buttons that try again or give
// up.

import type {Frame, SetAsideTask, TaskFailure} from './api';
import {commandField, copyCommand} from './command_field';
import {badge, byId, el, setText} from './dom';
import * as format from './format';
import type {JobActions} from './job_actions';
import type {Store} from './store';

// Frames, and failures of a task, that are shown.
const FRAMES_MAX = 20;
const FAILURES_MAX = 8;

export class SetAsideView {
  private readonly list = byId('aside');
  // The text on display.
  private shown = '';

  constructor(private readonly store: Store, private readonly actions: JobActions) {
    this.list.addEventListener('click', (event) => void this.onClick(event));
    for (const topic of ['jobs', 'frames', 'selection'] as const) store.listen(topic, this.draw);
  }

  private readonly draw = () => {
    const {job} = this.store;
    const troubled = job ? this.store.frames.sorted.filter(isTroubled) : [];
    byId('aside-section').hidden = troubled.length === 0;
    const frames = troubled.slice(0, FRAMES_MAX);
    const ended = !job || format.hasEnded(job);
    const key = JSON.stringify(
        [job?.name, ended, frames.map((frame) => [frame.name, frame.incomplete, tasksOf(frame)])]);
    // Redrawing the same would take the focus from its buttons.
    if (key === this.shown) return;
    this.shown = key;
    const rest = troubled.length - frames.length;
    setText(
        byId('aside-heading'),
        rest > 0 ? `Set aside: the first ${frames.length} of ${troubled.length} frames` :
                   'Set aside');
    this.list.replaceChildren(...frames.map((frame) => makeFrame(job?.name ?? '', frame, ended)));
  };

  private async onClick(event: MouseEvent) {
    const button = (event.target as Element).closest('button');
    if (!button) return;
    const {act, frame, task} = button.dataset;
    if (act === 'retry')
      this.actions.retry(Number(frame), task === undefined ? null : Number(task));
    else if (act === 'kill')
      await this.actions.killFrame(Number(frame));
    else
      await copyCommand(button);
  }
}

const tasksOf = (frame: Frame): SetAsideTask[] => frame.set_aside_tasks;

const isTroubled = (frame: Frame) =>
    Boolean(frame.incomplete) || frame.set_aside_task_count > 0;

function actionButton(words: string, act: string, frame: Frame, task?: SetAsideTask): HTMLElement {
  const danger = act === 'kill' ? ' danger' : '';
  return el(
      'button', {
        class: 'button' + danger,
        type: 'button',
        'data-act': act,
        'data-frame': String(frame.frame_number),
        'data-task': task ? String(task.task) : null
      },
      words);
}

function makeFrame(job: string, frame: Frame, ended: boolean): HTMLElement {
  const number = frame.frame_number;
  const count = frame.set_aside_task_count;
  const tasks = tasksOf(frame);
  const without = count === 0 ? '' : count === 1 ? ': 1 task' : ': ' + count + ' tasks';
  const state = frame.incomplete ? 'incomplete' : 'continues';
  const more = count > tasks.length ? [el('p', {class: 'job-small'}, 'and others')] : [];
  const own = count > 0 ? [] : [
    el('p', {class: 'failure-message'}, frame.incomplete),
    commandField(`sheaf bundle ${job} --frame ${number}`, 'Command that gets the frame')
  ];
  return el(
      'li', {class: 'aside-frame'},
      el('div', {class: 'aside-head'}, el('strong', {}, 'Frame ' + number),
         el('span', {class: 'job-small'}, state + without), el('span', {class: 'spread'}),
         actionButton('Retry frame', 'retry', frame),
         ...(ended || frame.incomplete ? [] : [actionButton('Give up frame…', 'kill', frame)])),
      ...own, ...tasks.map((task) => makeTask(job, frame, task)), ...more);
}

function makeTask(job: string, frame: Frame, task: SetAsideTask): HTMLElement {
  const {failures} = task;
  const rest = failures.length - FAILURES_MAX;
  const words = failures.length === 0 ?
      [el('p', {class: 'failure-message'}, task.why)] :
      failures.slice(0, FAILURES_MAX).map(makeFailure);
  const command = `sheaf bundle ${job} --frame ${frame.frame_number} --task ${task.task}`;
  return el(
      'div', {class: 'aside-task'},
      el('div', {class: 'aside-head'}, el('span', {title: task.why}, 'Task ' + task.task),
         el('span', {class: 'spread'}), actionButton('Retry task', 'retry', frame, task)),
      ...words, ...(rest > 0 ? [el('p', {class: 'job-small'}, 'and ' + rest + ' more')] : []),
      ...(failures.length > 0 ? [commandField(command, 'Command that gets the failed task')] : []));
}

function makeFailure(failure: TaskFailure): HTMLElement {
  const by = failure.worker ? format.shortName(failure.worker) : 'workers that vanished';
  const times = failure.count > 1 ? ', ' + failure.count + ' times' : '';
  const kind = badge('failed');
  kind.textContent = failure.kind;
  return el(
      'div', {}, el('p', {class: 'job-small'}, kind, ' on ' + by + times),
      el('p', {class: 'failure-message'}, failure.message));
}
