// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// One picture of the viewer as it grows, in the layer and exposure that a person chose. One version
// is fetched at a time and swapped in when it is decoded, so the picture never flickers and a slow
// link sees fewer versions, not a queue of them.

import * as api from './api';
import type {Frame, Layer, LayerRange} from './api';
import {byId, setText} from './dom';
import {Exposure} from './exposure';
import {PictureViewport} from './picture_viewport';
import type {Store} from './store';
import type {Size} from './view_transform';

// From asking for one version to asking for the next, at least; and from having it.
const REFRESH_MS = 350;
const REST_MS = 50;
// Pixels of a preview at most: larger pictures come shrunk (kPreviewPixelCountMax of the
// coordinator).
const PIXELS_MAX = 1 << 21;

// What a pane shall show.
export interface Wanted {
  frame: Frame|undefined;
  // Null for the picture as it is now.
  round: number|null;
  layer: Layer;
  stops: number;
  // What stands in the place of a picture that is not there.
  note: string;
}

export interface PaneOptions {
  // Of the elements: "picture" stands for "picture-box", "picture" and "picture-note".
  name: string;
  wanted: () => Wanted;
  onView: () => void;
  onRange: (layer: Layer, range: LayerRange|null) => void;
}

export class PicturePane {
  readonly viewport: PictureViewport;
  private readonly box: HTMLElement;
  private readonly note: HTMLElement;
  private readonly attempt: string;
  private readonly exposure: Exposure;
  // What is shown or on its way to be shown: the path, or '' for nothing.
  private shown = '';
  private isEmpty = true;
  private fetching = false;
  private rest: ReturnType<typeof setTimeout>|undefined;

  constructor(private readonly store: Store, private readonly options: PaneOptions) {
    const {name} = options;
    this.box = byId(name + '-box');
    this.note = byId(name + '-note');
    const what = name === 'picture' ? 'the image' : 'the compared image';
    this.attempt = 'loading ' + what;
    this.viewport = new PictureViewport(this.box, byId(name), options.onView);
    const attempt = 'exposing ' + what;
    this.exposure = new Exposure((key, picture) => {
      this.store.note(attempt, null);
      if (key === this.shown)
        this.setPicture(picture);
      else
        picture.close();
    }, (failure) => this.store.note(attempt, failure));
  }

  readonly draw = () => {
    const {frame, note} = this.options.wanted();
    const hasPicture = frame !== undefined && frame.preview_version > 0;
    if (!hasPicture) this.clear();
    this.drawNote(note);
    this.setShape(frame);
    if (!hasPicture || this.fetching || this.rest !== undefined) return;
    const path = this.wantedPath();
    if (path !== this.shown) void this.fetch(frame, path);
  };

  // Shows nothing from now on.
  clear() {
    this.shown = '';
    this.isEmpty = true;
    this.viewport.setPicture(null);
    this.options.onRange('picture', null);
  }

  // Another layer or round does not wait for the next version; another exposure of light that is
  // there needs no fetch at all.
  hurry() {
    clearTimeout(this.rest);
    this.rest = undefined;
    const {layer, stops} = this.options.wanted();
    if (this.shown && this.shown === this.wantedPath() && layer === 'light') {
      this.exposure.ask(this.shown, null, stops);
    }
    this.draw();
  }

  private wantedPath(): string {
    const {frame, layer, round} = this.options.wanted();
    return frame ? api.previewPath(frame, layer, round) : '';
  }

  private drawNote(note: string) {
    this.note.hidden = !this.isEmpty;
    setText(this.note, note);
  }

  // Keeps the place free before the first pixel is there.
  private setShape(frame: Frame|undefined) {
    if (!frame) return;
    const width = frame.window.x1_px - frame.window.x0_px;
    const height = frame.window.y1_px - frame.window.y0_px;
    this.box.style.setProperty('--picture-shape', width + ' / ' + height);
    byId(this.options.name)
        .setAttribute(
            'aria-label',
            'Frame ' + frame.frame_number + ' as rendered so far, ' + width + ' by ' + height +
                ' pixels');
  }

  private async fetch(frame: Frame, path: string) {
    this.fetching = true;
    const begin = performance.now();
    const {layer} = this.options.wanted();
    try {
      const preview = await api.getPreview(path);
      this.store.note(this.attempt, null);
      // Another frame, layer or round may have been chosen meanwhile; a newer version is no other.
      const wanted = this.options.wanted();
      if (isSame(wanted, frame, path)) {
        this.show(path, layer, preview?.bitmap ?? null, preview?.range ?? null);
        this.drawNote(preview ? '' : wanted.note);
      } else {
        preview?.bitmap.close();
      }
    } catch (failure) {
      // The next version, or the next event, tries again.
      this.store.note(this.attempt, failure);
    }
    this.fetching = false;
    const changed = !isSame(this.options.wanted(), frame, path);
    const rest = Math.max(REST_MS, REFRESH_MS - (performance.now() - begin));
    this.rest = setTimeout(() => {
      this.rest = undefined;
      this.draw();
    }, changed ? 0 : rest);
  }

  // Null where there is no such picture.
  private show(path: string, layer: Layer, bitmap: ImageBitmap|null, range: LayerRange|null) {
    this.shown = path;
    this.isEmpty = bitmap === null;
    if (bitmap && layer === 'light')
      this.exposure.ask(path, bitmap, this.options.wanted().stops);
    else if (bitmap)
      this.setPicture(bitmap);
    else
      this.viewport.setPicture(null);
    this.options.onRange(layer, range);
  }

  // A round's smaller picture is seen in the place of the whole one.
  private setPicture(bitmap: ImageBitmap) {
    const {frame, round} = this.options.wanted();
    this.viewport.setPicture(bitmap, frame && round !== null ? shownSize(frame) : bitmap);
  }
}

// Whether what was fetched is still wanted, if perhaps in a newer version.
function isSame(wanted: Wanted, frame: Frame, path: string): boolean {
  if (wanted.frame?.name !== frame.name) return false;
  return api.previewPath(frame, wanted.layer, wanted.round) === path;
}

// Of a frame's preview.
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
