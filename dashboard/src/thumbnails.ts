// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Thumbnails in rows of lists. A row shows another frame when the list is scrolled.

import * as api from './api';
import type {PreviewFrame} from './api';
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
    const image =
        el('img', {alt: '', decoding: 'async', fetchpriority: 'low', hidden: ''}) as
        HTMLImageElement;
    image.addEventListener('load', () => {
      image.hidden = false;
    });
    image.addEventListener('error', () => {
      image.hidden = true;
    });
    return image;
  }

  // image: an image that make() returned. Null hides it.
  show(image: HTMLImageElement, frame: PreviewFrame|null) {
    const path = frame && frame.preview_version > 0 ? this.pathOf(frame) : '';
    if (image.dataset.path === path) return;
    image.dataset.path = path;
    const frameName = path && frame ? frame.name : '';
    if (frameName && image.dataset.frame === frameName) {
      image.src = path;
      return;
    }
    image.dataset.frame = frameName;
    image.hidden = true;
    image.removeAttribute('src');
    if (!path) return;
    setTimeout(() => {
      if (image.dataset.path === path) image.src = path;
    }, SETTLED_MS);
  }

  // The path of the newest version, or of an earlier one that is recent enough.
  private pathOf(frame: PreviewFrame): string {
    const path = api.thumbnailPath(frame);
    const known = this.shown.get(frame.name);
    const {complete} = frame;
    const time = performance.now();
    if (known?.complete === complete && time - known.time < REFRESH_MS) return known.path;
    if (known?.path !== path) this.shown.set(frame.name, {path, complete, time});
    return path;
  }
}
