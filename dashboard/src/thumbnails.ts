// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Small pictures in rows of lists, which show another frame when the list is scrolled.

import * as api from './api';
import type {Pictured} from './api';
import {el} from './dom';

// Between two pictures of a frame that is being rendered.
const REFRESH_MS = 5000;
// A row that shows another frame by then was only scrolled past, and asks for no picture.
const SETTLED_MS = 100;

interface Shown {
  path: string;
  complete: boolean;
  time: number;
}

export class Thumbnails {
  // By the frame's name.
  private readonly shown = new Map<string, Shown>();

  clear() {
    this.shown.clear();
  }

  // Hidden until something comes.
  static make(): HTMLImageElement {
    const picture =
        el('img', {alt: '', decoding: 'async', fetchpriority: 'low', hidden: ''}) as
        HTMLImageElement;
    picture.addEventListener('load', () => {
      picture.hidden = false;
    });
    picture.addEventListener('error', () => {
      picture.hidden = true;
    });
    return picture;
  }

  // In an image that make() returned; null shows none.
  show(picture: HTMLImageElement, frame: Pictured|null) {
    const path = frame && frame.preview_version > 0 ? this.pathOf(frame) : '';
    if (picture.dataset.path === path) return;
    picture.dataset.path = path;
    const frameName = path && frame ? frame.name : '';
    if (frameName && picture.dataset.frame === frameName) {
      picture.src = path;
      return;
    }
    picture.dataset.frame = frameName;
    picture.hidden = true;
    picture.removeAttribute('src');
    if (!path) return;
    setTimeout(() => {
      if (picture.dataset.path === path) picture.src = path;
    }, SETTLED_MS);
  }

  // Of the newest version, or of one that is not old yet.
  private pathOf(frame: Pictured): string {
    const path = api.thumbnailPath(frame);
    const known = this.shown.get(frame.name);
    const {complete} = frame;
    const time = performance.now();
    if (known?.complete === complete && time - known.time < REFRESH_MS) return known.path;
    if (known?.path !== path) this.shown.set(frame.name, {path, complete, time});
    return path;
  }
}
