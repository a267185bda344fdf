// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The frames of the selected job as a strip of small buttons that fill up as they are rendered.

import {byId, el, setText} from './dom.js';
import * as format from './format.js';

export class FramesView {
  constructor(store, select, loadMore) {
    this.store = store;
    this.select = select;
    this.buttons = new Map();
    byId('frames').addEventListener('click', (event) => this.onClick(event));
    byId('frames').addEventListener('keydown', (event) => this.onKey(event));
    byId('frames-more').addEventListener('click', loadMore);
    for (const topic of ['frames', 'selection']) store.listen(topic, this.draw);
  }

  draw = () => {
    const frames = [...this.store.frames.values()].sort((a, b) => a.frame_number - b.frame_number);
    const current = this.store.frame;
    byId('frames-section').hidden = frames.length < 2;
    byId('frames-more').hidden = !this.store.framesToken;
    const names = frames.map((frame) => frame.name);
    if (names.length !== this.buttons.size || names.some((name) => !this.buttons.has(name))) {
      this.buttons = new Map(frames.map((frame) => [frame.name, makeButton(frame)]));
      byId('frames').replaceChildren(...this.buttons.values());
    }
    for (const frame of frames) updateButton(this.buttons.get(frame.name), frame, current);
  };

  onClick(event) {
    const button = event.target.closest('button');
    if (button) this.select(button.dataset.name);
  }

  onKey(event) {
    const step = {ArrowRight: 1, ArrowLeft: -1}[event.key];
    const buttons = [...this.buttons.values()];
    const next = buttons[buttons.indexOf(event.target) + step];
    if (step === undefined || !next) return;
    event.preventDefault();
    next.focus();
    this.select(next.dataset.name);
  }
}

function makeButton(frame) {
  return el(
      'button', {class: 'frame', type: 'button', 'data-name': frame.name},
      el('span', {class: 'frame-fill'}),
      el('span', {class: 'frame-number'}, String(frame.frame_number)));
}

function updateButton(button, frame, current) {
  const share = format.doneShare(frame.progress);
  const chosen = Boolean(current) && frame.name === current.name;
  button.firstElementChild.style.width = share * 100 + '%';
  button.dataset.complete = frame.complete ? 'yes' : 'no';
  button.setAttribute('aria-pressed', chosen);
  button.tabIndex = chosen ? 0 : -1;
  const label =
      'Frame ' + frame.frame_number + ', ' + (frame.complete ? 'complete' : format.percent(share));
  if (button.title !== label) {
    button.title = label;
    button.setAttribute('aria-label', label);
  }
  setText(button.lastElementChild, String(frame.frame_number));
}
