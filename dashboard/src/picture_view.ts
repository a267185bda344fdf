// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The picture of the shown frame as it grows. One version is fetched at a time and swapped in when
// it is decoded, so the picture never flickers and a slow link sees fewer versions, not a queue of
// them.

import * as api from './api';
import type {Frame, Job} from './api';
import {byId, setText} from './dom';
import type {Store} from './store';

// Between two versions at least.
const REFRESH_MS = 400;

export class PictureView {
  private readonly image = byId<HTMLImageElement>('picture');
  private shown = '';
  private job: string|null = null;
  private busy = false;

  constructor(private readonly store: Store) {
    byId('picture-zoom').addEventListener('click', () => this.toggleZoom());
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
    if (hasPicture && !this.busy && api.previewPath(frame) !== this.shown) this.fetch(frame);
  };

  private clear() {
    this.shown = '';
    this.image.hidden = true;
    this.image.removeAttribute('src');
  }

  // Keeps the place free before the first pixel is there.
  private setShape(frame: Frame|undefined) {
    if (!frame) return;
    const width = frame.window.x1_px - frame.window.x0_px;
    const height = frame.window.y1_px - frame.window.y0_px;
    byId('picture-box').style.aspectRatio = width + ' / ' + height;
    this.image.alt = 'Frame ' + frame.frame_number + ' as rendered so far, ' + width + ' by ' +
        height + ' pixels';
  }

  private async fetch(frame: Frame) {
    this.busy = true;
    const path = api.previewPath(frame);
    try {
      const next = new Image();
      next.src = path;
      await next.decode();
      // Another frame may have been chosen meanwhile.
      if (this.store.frame && this.store.frame.name === frame.name) {
        this.image.src = path;
        this.image.hidden = false;
        this.shown = path;
      }
    } catch {
      // The next version, or the next event, tries again.
    }
    byId('picture-note').hidden = Boolean(this.shown);
    setTimeout(() => {
      this.busy = false;
      this.draw();
    }, REFRESH_MS);
  }

  private toggleZoom() {
    const actual = byId('picture-box').classList.toggle('actual-size');
    byId('picture-zoom').setAttribute('aria-pressed', String(actual));
  }
}

function noteOf(job: Job|undefined, frame: Frame|undefined): string {
  if (!job) return 'Choose a job to see its picture.';
  if (job.waiting_reason) return 'Waiting: ' + job.waiting_reason;
  return frame ? 'No samples yet.' : '';
}
