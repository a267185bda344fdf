// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The viewer over the whole window and, where the browser allows it, over the whole screen. Escape
// or the button lead back.

import {byId} from './dom';

export class FullScreen {
  private readonly viewer = byId('viewer');
  private readonly button = byId('full-screen');

  constructor() {
    this.button.addEventListener('click', () => this.toggle());
    document.addEventListener('fullscreenchange', () => {
      if (!document.fullscreenElement) this.set(false);
    });
    document.addEventListener('keydown', (event) => {
      if (event.key !== 'Escape' || !this.isFull || document.querySelector('dialog[open]')) return;
      this.toggle();
    });
  }

  get isFull(): boolean {
    return this.viewer.dataset.full === 'yes';
  }

  toggle() {
    const full = !this.isFull;
    this.set(full);
    // Without the permission the viewer still fills the window.
    if (full)
      void document.documentElement.requestFullscreen?.().catch(() => {});
    else if (document.fullscreenElement)
      void document.exitFullscreen().catch(() => {});
  }

  private set(full: boolean) {
    this.viewer.dataset.full = full ? 'yes' : 'no';
    document.body.dataset.full = full ? 'yes' : 'no';
    this.button.setAttribute('aria-pressed', String(full));
    if (full) byId('image-box').focus();
  }
}
