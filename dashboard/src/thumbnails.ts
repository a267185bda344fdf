// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Thumbnails in rows of lists. A row shows another frame when the list is scrolled.

import * as api from './api';
import type {Pictured} from './api';
import {el} from './dom';

// Minimum time between two images of a frame that is being rendered.
const REFRESH_MS = 5000;
// A row requests its image only if it still shows the frame after this time: others were scrolled
// past.
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

  // The image is hidden until it has loaded.
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

  // picture: an image that make() returned. Null hides it.
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

  // The path of the newest version, or of an earlier one that is recent enough.
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
