// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The picture of the shown frame as it grows, in the layer and exposure that a person chose. One
// version is fetched at a time and swapped in when it is decoded, so the picture never flickers and
// a slow link sees fewer versions, not a queue of them.

import * as api from './api';
import type {Frame, Job, Layer, LayerRange} from './api';
import {byId, setText} from './dom';
import {Exposure} from './exposure';
import {PictureViewport} from './picture_viewport';
import {RoundSlider} from './round_slider';
import type {Store} from './store';
import {ViewerControls} from './viewer_controls';
import type {Size} from './view_transform';

// Between two versions at least.
const REFRESH_MS = 400;
const ATTEMPT = 'loading the picture';
// Pixels of a preview at most: larger pictures come shrunk (kPreviewPixelCountMax of the
// coordinator).
const PIXELS_MAX = 1 << 21;

export class PictureView {
  private readonly box = byId('picture-box');
  private readonly viewport =
      new PictureViewport(this.box, byId('picture'), () => this.controls.drawZoom());
  private readonly controls = new ViewerControls(this.viewport, () => this.onControls());
  private readonly exposure = new Exposure(
      (key, picture) => this.showExposed(key, picture),
      (failure) => this.store.note('exposing the picture', failure));
  private readonly rounds = new RoundSlider(() => this.onControls());
  // What is shown or on its way to be shown: the path, or '' for nothing.
  private shown = '';
  private job: string|null = null;
  private fetching = false;
  private rest: ReturnType<typeof setTimeout>|undefined;

  constructor(private readonly store: Store) {
    for (const topic of ['frames', 'selection'] as const) store.listen(topic, this.draw);
  }

  private readonly draw = () => {
    const frame = this.store.frame;
    const hasPicture = frame !== undefined && frame.preview_version > 0;
    // While a frame of the same job has its first picture on the way, the one before stays.
    if (!hasPicture || this.job !== this.store.jobName) this.clear();
    this.job = this.store.jobName;
    byId('picture-note').hidden = Boolean(this.shown);
    setText(byId('picture-note'), noteOf(this.store.job, frame));
    this.setShape(frame);
    this.rounds.show(frame);
    if (!hasPicture || this.fetching || this.rest !== undefined) return;
    const path = this.pathOf(frame);
    if (path !== this.shown) void this.fetch(frame, this.controls.layer, path);
  };

  private clear() {
    this.shown = '';
    this.viewport.setPicture(null);
    this.controls.drawLegend('picture', null);
  }

  // Keeps the place free before the first pixel is there.
  private setShape(frame: Frame|undefined) {
    if (!frame) return;
    const width = frame.window.x1_px - frame.window.x0_px;
    const height = frame.window.y1_px - frame.window.y0_px;
    this.box.style.setProperty('--picture-shape', width + ' / ' + height);
    byId('picture').setAttribute(
        'aria-label',
        'Frame ' + frame.frame_number + ' as rendered so far, ' + width + ' by ' + height +
            ' pixels');
  }

  // Another layer or round does not wait for the next version; another exposure of light that is
  // there needs no fetch at all.
  private onControls() {
    clearTimeout(this.rest);
    this.rest = undefined;
    if (this.shown && this.shown === this.wantedPath() && this.controls.layer === 'light') {
      this.exposure.ask(this.shown, null, this.controls.stops);
    }
    this.draw();
  }

  private wantedPath(): string {
    const frame = this.store.frame;
    return frame ? this.pathOf(frame) : '';
  }

  private pathOf(frame: Frame): string {
    const {layer} = this.controls;
    // Times are known of all rounds together.
    return api.previewPath(frame, layer, layer === 'time' ? null : this.rounds.round);
  }

  private async fetch(frame: Frame, layer: Layer, path: string) {
    this.fetching = true;
    try {
      const preview = await api.getPreview(path);
      this.store.note(ATTEMPT, null);
      // Another frame, layer or round may have been chosen meanwhile; a newer version is no other.
      const wanted = this.store.frame?.name === frame.name && this.pathOf(frame) === path;
      if (preview && wanted)
        this.show(path, layer, preview.bitmap, preview.range);
      else
        preview?.bitmap.close();
    } catch (failure) {
      // The next version, or the next event, tries again.
      this.store.note(ATTEMPT, failure);
    }
    this.fetching = false;
    const changed = this.pathOf(frame) !== path;
    byId('picture-note').hidden = Boolean(this.shown);
    this.rest = setTimeout(() => {
      this.rest = undefined;
      this.draw();
    }, changed ? 0 : REFRESH_MS);
  }

  private show(path: string, layer: Layer, bitmap: ImageBitmap, range: LayerRange|null) {
    this.shown = path;
    if (layer === 'light')
      this.exposure.ask(path, bitmap, this.controls.stops);
    else
      this.setPicture(bitmap);
    this.controls.drawLegend(layer, range);
  }

  // A round's smaller picture is seen in the place of the whole one.
  private setPicture(bitmap: ImageBitmap) {
    const frame = this.store.frame;
    this.viewport.setPicture(bitmap, frame ? shownSize(frame) : bitmap);
  }

  private showExposed(key: string, picture: ImageBitmap) {
    this.store.note('exposing the picture', null);
    if (key === this.shown)
      this.setPicture(picture);
    else
      picture.close();
  }
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

function noteOf(job: Job|undefined, frame: Frame|undefined): string {
  if (!job) return 'Choose a job to see its picture.';
  if (job.waiting_reason) return 'Waiting: ' + job.waiting_reason;
  if (job.state === 'paused') return 'Paused before the first samples.';
  return frame ? 'No samples yet.' : '';
}
