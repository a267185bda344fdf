// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// One image of the viewer while it is rendered, in the chosen layer and exposure. One version is
// fetched at a time and swapped in after it is decoded, so the image never flickers, and a slow
// link skips versions instead of queueing them.

import * as api from './api';
import type {Frame, Layer, LayerRange, View} from './api';
import {byId, setText} from './dom';
import {Exposure} from './exposure';
import {composeEyes} from './eyes';
import type {EyesMode} from './eyes';
import type {Development} from './exposure';
import type {Histogram} from './light_bins';
import {ImageViewport} from './image_viewport';
import type {Store} from './store';
import type {Size} from './view_transform';

// Minimum time from one request to the next, and from one reply to the next request.
const REFRESH_MS = 350;
const REST_MS = 50;
// Maximum number of pixels of a preview; larger images are reduced (kPreviewPixelCountMax of the
// coordinator).
const PIXELS_MAX = 1 << 21;

// The content that a pane should show.
export interface Wanted {
  frame: Frame|undefined;
  // Null for the present image.
  round: number|null;
  view: View;
  development: Development;
  // Whether the histogram is shown.
  histogram: boolean;
  // Text shown if there is no image.
  note: string;
}

export interface PaneOptions {
  // Prefix of the element ids: "image" stands for "image-box", "image" and "image-note".
  name: string;
  wanted: () => Wanted;
  // How both eyes of a stereo frame are shown.
  eyes: () => EyesMode;
  onView: () => void;
  onRange: (layer: Layer, range: LayerRange|null) => void;
  onHistogram: (histogram: Histogram|null) => void;
}

// Changes that take longer are announced in the image.
const LOADING_SHOWN_MS = 250;

export class ImagePane {
  readonly viewport: ImageViewport;
  private readonly box: HTMLElement;
  private readonly note: HTMLElement;
  private readonly attempt: string;
  private readonly exposure: Exposure;
  // The path that is shown or being fetched, or '' for none.
  private shown = '';
  private isEmpty = true;
  private fetching = false;
  private rest: ReturnType<typeof setTimeout>|undefined;

  constructor(private readonly store: Store, private readonly options: PaneOptions) {
    const {name} = options;
    this.box = byId(name + '-box');
    this.note = byId(name + '-note');
    const what = name === 'image' ? 'the image' : 'the compared image';
    this.attempt = 'loading ' + what;
    this.viewport = new ImageViewport(this.box, byId(name), options.onView);
    const attempt = 'exposing ' + what;
    this.exposure = new Exposure({
      onImage: (key, image, range) => {
        this.store.note(attempt, null);
        // An older version is better than none while newer ones come faster than they are exposed.
        if (withoutVersion(key) !== withoutVersion(this.shown)) return image.close();
        this.setImage(image);
        options.onRange('light', range);
      },
      onHistogram: (key, histogram) => {
        if (withoutVersion(key) === withoutVersion(this.shown)) options.onHistogram(histogram);
      },
      onFailure: (failure) => this.store.note(attempt, failure),
    });
  }

  readonly draw = () => {
    const {frame, note} = this.options.wanted();
    const hasImage = frame !== undefined && frame.preview_version > 0;
    if (!hasImage) this.clear();
    this.drawNote(note);
    this.setShape(frame);
    if (!hasImage || this.fetching || this.rest !== undefined) return;
    const path = this.wantedPath();
    if (path !== this.shown) void this.fetch(frame, path);
  };

  // Removes the image.
  clear() {
    this.shown = '';
    this.isEmpty = true;
    this.viewport.setImage(null);
    this.noteDrawn();
    this.options.onRange('image', null);
    this.options.onHistogram(null);
  }

  // Shows the same image anew.
  again() {
    this.shown = '';
    this.hurry();
  }

  private async countPalette() {
    const copy = await this.viewport.copyOfImage();
    if (copy) this.exposure.askPalette(this.shown, copy);
  }

  // Another layer or round does not wait for the next version; another exposure of light that is
  // already here needs no fetch.
  hurry() {
    clearTimeout(this.rest);
    this.rest = undefined;
    const {view, development, histogram} = this.options.wanted();
    if (this.shown && this.shown === this.wantedPath()) {
      if (view.layer === 'light') this.exposure.ask(this.shown, null, development);
      if (view.layer !== 'light' && histogram) void this.countPalette();
    }
    this.draw();
  }

  private wantedPath(): string {
    const {frame, view, round} = this.options.wanted();
    return frame ? api.previewPath(frame, view, round) : '';
  }

  private drawNote(note: string) {
    this.note.hidden = !this.isEmpty;
    setText(this.note, note);
  }

  // Reserves the space before the first pixel arrives.
  private setShape(frame: Frame|undefined) {
    if (!frame) return;
    const both = frame.window.x1_px - frame.window.x0_px;
    const width = this.options.eyes() === 'both' ? both : Math.floor(both / 2);
    const height = frame.window.y1_px - frame.window.y0_px;
    this.box.style.setProperty('--image-shape', width + ' / ' + height);
    byId(this.options.name)
        .setAttribute(
            'aria-label',
            'Frame ' + frame.frame_number + ' as rendered so far, ' + width + ' by ' + height +
                ' pixels');
  }

  private async fetch(frame: Frame, path: string) {
    this.fetching = true;
    const begin = performance.now();
    const {layer} = this.options.wanted().view;
    // A newer version of the same image comes unnoticed.
    const isOther = withoutVersion(path) !== withoutVersion(this.shown);
    const announce = setTimeout(() => {
      if (isOther) this.box.dataset.loading = 'yes';
    }, LOADING_SHOWN_MS);
    try {
      const preview = await api.getPreview(path);
      this.store.note(this.attempt, null);
      // Meanwhile another frame, layer or round may have been chosen; a newer version does not
      // count as another.
      const wanted = this.options.wanted();
      if (isSame(wanted, frame, path)) {
        this.show(path, layer, preview?.bitmap ?? null, preview?.range ?? null);
        this.drawNote(preview ? '' : wanted.note);
      } else {
        preview?.bitmap.close();
      }
    } catch (failure) {
      const {of} = this.options.wanted().view;
      if (of && failure instanceof api.ApiError && failure.status === 404) {
        // Two jobs may have different layers.
        this.show(path, layer, null, null);
        this.drawNote('This frame has no layer ' + of + '.');
      } else {
        // The next version or event tries again.
        this.store.note(this.attempt, failure);
      }
    }
    clearTimeout(announce);
    delete this.box.dataset.loading;
    this.fetching = false;
    const changed = !isSame(this.options.wanted(), frame, path);
    const rest = Math.max(REST_MS, REFRESH_MS - (performance.now() - begin));
    this.rest = setTimeout(() => {
      this.rest = undefined;
      this.draw();
    }, changed ? 0 : rest);
  }

  // Null if there is no such image.
  private show(path: string, layer: Layer, bitmap: ImageBitmap|null, range: LayerRange|null) {
    this.shown = path;
    this.isEmpty = bitmap === null;
    const {development, histogram} = this.options.wanted();
    if (bitmap && layer === 'light') return this.exposure.ask(path, bitmap, development);
    if (bitmap) {
      this.setImage(bitmap);
    } else {
      this.viewport.setImage(null);
      this.noteDrawn();
    }
    this.options.onRange(layer, range);
    if (bitmap && histogram)
      void this.countPalette();
    else
      this.options.onHistogram(null);
  }

  // A round's smaller image is scaled to the size of the full one.
  private setImage(bitmap: ImageBitmap) {
    const {frame, round} = this.options.wanted();
    const {width, height} = frame && round !== null ? shownSize(frame) : bitmap;
    const mode = this.options.eyes();
    this.viewport.setImage(
        composeEyes(bitmap, mode),
        {width: mode === 'both' ? width : Math.floor(width / 2), height});
    this.noteDrawn();
  }

  // Leaves in the document which version is drawn; tests of the page wait for it.
  private noteDrawn() {
    byId(this.options.name).dataset.drawn = this.shown;
  }
}

const withoutVersion = (path: string) => path.replace(/&version=.*/, '');

// Whether the fetched image is still wanted, possibly in a newer version.
function isSame(wanted: Wanted, frame: Frame, path: string): boolean {
  if (wanted.frame?.name !== frame.name) return false;
  return api.previewPath(frame, wanted.view, wanted.round) === path;
}

// Size of a frame's preview.
function shownSize({window}: Frame): Size {
  const width = window.x1_px - window.x0_px;
  const height = window.y1_px - window.y0_px;
  const whole = (length: number, factor: number) => Math.floor(length / factor);
  let factor = 1;
  while (whole(width, factor) * whole(height, factor) > PIXELS_MAX &&
         factor < Math.min(width, height)) {
    ++factor;
  }
  return {width: whole(width, factor), height: whole(height, factor)};
}
