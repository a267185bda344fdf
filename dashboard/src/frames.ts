// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The frames of the selected job as a strip of small buttons that fill up as they are rendered.

import type {Frame} from './api';
import {byId, child, el, setText} from './dom';
import * as format from './format';
import type {Store} from './store';

export class FramesView {
  private buttons = new Map<string, HTMLButtonElement>();

  constructor(
      private readonly store: Store, private readonly select: (name: string) => void,
      loadMore: () => void) {
    byId('frames').addEventListener('click', (event) => this.onClick(event));
    byId('frames').addEventListener('keydown', (event) => this.onKey(event));
    byId('frames-more').addEventListener('click', loadMore);
    for (const topic of ['frames', 'selection'] as const) store.listen(topic, this.draw);
  }

  private readonly draw = () => {
    const frames = [...this.store.frames.values()].sort((a, b) => a.frame_number - b.frame_number);
    const current = this.store.frame;
    byId('frames-section').hidden = frames.length < 2;
    byId('frames-more').hidden = !this.store.framesToken;
    const names = frames.map((frame) => frame.name);
    if (names.length !== this.buttons.size || names.some((name) => !this.buttons.has(name))) {
      this.buttons = new Map(frames.map((frame) => [frame.name, makeButton(frame)]));
      byId('frames').replaceChildren(...this.buttons.values());
    }
    for (const frame of frames) {
      const button = this.buttons.get(frame.name);
      if (button) updateButton(button, frame, current);
    }
  };

  private onClick(event: MouseEvent) {
    const button = (event.target as Element).closest('button');
    if (button) this.select(button.dataset.name ?? '');
  }

  private onKey(event: KeyboardEvent) {
    const step = event.key === 'ArrowRight' ? 1 : event.key === 'ArrowLeft' ? -1 : 0;
    const buttons = [...this.buttons.values()];
    const next = buttons[buttons.indexOf(event.target as HTMLButtonElement) + step];
    if (step === 0 || !next) return;
    event.preventDefault();
    next.focus();
    this.select(next.dataset.name ?? '');
  }
}

function makeButton(frame: Frame): HTMLButtonElement {
  return el('button', {class: 'frame', type: 'button', 'data-name': frame.name},
            el('span', {class: 'frame-fill'}),
            el('span', {class: 'frame-number'}, String(frame.frame_number))) as HTMLButtonElement;
}

function updateButton(button: HTMLButtonElement, frame: Frame, current: Frame|undefined) {
  const share = format.doneShare(frame.progress);
  const chosen = frame.name === current?.name;
  child(button, 0).style.width = share * 100 + '%';
  button.dataset.complete = frame.complete ? 'yes' : 'no';
  button.setAttribute('aria-pressed', String(chosen));
  button.tabIndex = chosen ? 0 : -1;
  const label =
      'Frame ' + frame.frame_number + ', ' + (frame.complete ? 'complete' : format.percent(share));
  if (button.title !== label) {
    button.title = label;
    button.setAttribute('aria-label', label);
  }
  setText(child(button, 1), String(frame.frame_number));
}
