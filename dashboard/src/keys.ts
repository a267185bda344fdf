// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Keys of the whole page, and the overlay that lists them. Single letters can be turned off, for
// people whose speech input types them (WCAG 2.1, 2.1.4); those of the viewer then still work
// inside of it.

import {byId, el} from './dom';
import type {FarmViews} from './farm_views';
import type {ImageView} from './image_view';
import type {Store} from './store';
import {isTyping} from './viewer_controls';

const KEY = 'sheaf-single-keys';

const HELP: [string, [string, string][]][] = [
  [
    'Anywhere',
    [
      ['?', 'this list'],
      ['v t w y', 'image, table of jobs, workers, history'],
      ['/', 'search'],
      ['j k', 'next and previous job'],
      ['. ,', 'next and previous frame'],
    ]
  ],
  [
    'Image',
    [
      ['f', 'full screen'],
      ['+ − 0 1', 'zoom in, out, fit, 1:1; the wheel zooms about the pointer'],
      ['arrows', 'pan; with Shift: read the next pixel'],
      ['[ ] e', 'exposure −½, +½ stop, automatic'],
      ['l L', 'next and previous layer'],
      ['c h', 'false color, histogram'],
      ['b', 'flip between the image and the compared one'],
      ['s', 'split, or side by side'],
      ['d', 'denoised layer beside the image'],
      ['x', 'other eye of a stereo image'],
    ]
  ],
  [
    'Tables',
    [
      ['↑ ↓', 'move; with Shift: choose all between'],
      ['Space', 'choose a row or not'],
      ['Ctrl+A', 'choose all'],
      ['Esc', 'choose none'],
      ['Enter', 'open the job, or the frame that the worker renders'],
    ]
  ],
];

export function startKeys(
    store: Store, views: FarmViews, image: () => ImageView | null, select: (name: string) => void) {
  const help = byId<HTMLDialogElement>('help');
  const single = byId<HTMLInputElement>('help-single');
  single.checked = localStorage.getItem(KEY) !== 'off';
  single.addEventListener('change', () => localStorage.setItem(KEY, single.checked ? 'on' : 'off'));
  byId('help-list').replaceChildren(...HELP.map(([title, rows]) => section(title, rows)));
  const openHelp = () => {
    if (!help.open) help.showModal();
  };
  byId('help-open').addEventListener('click', openHelp);

  const actionOf = (key: string): (() => void)|undefined => {
    const actions: Record<string, () => void> = {
      '?': openHelp,
      '/': () => focusSearch(store),
      'v': () => views.open('image'),
      't': () => views.open('jobs'),
      'w': () => views.open('workers'),
      'y': () => views.open('history'),
      'j': () => select(nextJob(store, 1)),
      'k': () => select(nextJob(store, -1)),
      '.': () => select(nextFrame(store, 1)),
      ',': () => select(nextFrame(store, -1)),
    };
    return actions[key] ?? (store.view === 'image' ? image()?.actionOf(key) : undefined);
  };
  document.addEventListener('keydown', (event) => {
    if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey) return;
    if (!single.checked || isTyping(event) || document.querySelector('dialog[open]')) return;
    const act = actionOf(event.key);
    if (!act) return;
    event.preventDefault();
    act();
  });
}

function section(title: string, rows: readonly[string, string][]): HTMLElement {
  return el(
      'section', {}, el('h3', {}, title),
      el('dl', {},
         ...rows.map(
             ([keys, words]) =>
                 el('div', {}, el('dt', {}, ...keys.split(' ').map((key) => el('kbd', {}, key))),
                    el('dd', {}, words)))));
}

function focusSearch(store: Store) {
  const ids = {image: 'job-filter', jobs: 'table-filter', workers: 'worker-filter', history: ''};
  const id = ids[store.view];
  if (id) byId<HTMLInputElement>(id).select();
  if (id) byId(id).focus();
}

// In the order of the list; the present one at its ends.
function nextJob(store: Store, step: number): string {
  const jobs = store.jobs.sorted;
  const at = jobs.findIndex((job) => job.name === store.jobName);
  const next = jobs[Math.max(0, Math.min(jobs.length - 1, at + step))];
  return next?.name ?? store.jobName ?? '';
}

function nextFrame(store: Store, step: number): string {
  const frames = store.frames.sorted;
  const at = frames.findIndex((frame) => frame.name === store.frame?.name);
  const next = frames[Math.max(0, Math.min(frames.length - 1, at + step))];
  return next?.name ?? store.jobName ?? '';
}
