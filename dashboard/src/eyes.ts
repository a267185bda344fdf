// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// How both eyes of a stereo frame are shown: side by side, as the frame has them; the right one in
// the place of the left one, by turns; or as an anaglyph, for glasses with a red filter before the
// left eye and a cyan one before the right.

import type {Frame} from './api';
import {byId} from './dom';
import type {Store} from './store';

export type EyesMode = 'both'|'anaglyph'|'left'|'right';

export class EyesChoice {
  private readonly select = byId<HTMLSelectElement>('eyes');

  // onChange: the user chose another way.
  constructor(private readonly store: Store, private readonly onChange: () => void) {
    this.select.addEventListener('change', () => onChange());
    for (const topic of ['frames', 'selection'] as const) store.listen(topic, this.draw);
  }

  get mode(): EyesMode {
    return isStereo(this.store.frame) ? this.select.value as EyesMode : 'both';
  }

  // The share of the image that a part of what is shown has, from 0 to 1 on both sides.
  shareOf(x: number): number {
    if (this.mode === 'both') return x;
    return this.mode === 'right' ? (1 + x) / 2 : x / 2;
  }

  // Shows the other eye in the same place.
  flip() {
    if (!isStereo(this.store.frame)) return;
    this.select.value = this.select.value === 'left' ? 'right' : 'left';
    this.onChange();
  }

  private readonly draw = () => {
    const stereo = isStereo(this.store.frame);
    byId('eyes-label').hidden = !stereo;
    byId('viewer').dataset.stereo = stereo ? 'yes' : 'no';
  };
}

export const isStereo = (frame: Frame|undefined) => (frame?.eye_distance ?? 0) > 0;

// The image of both eyes as the mode shows it. Takes the bitmap.
export function composeEyes(bitmap: ImageBitmap, mode: EyesMode): ImageBitmap {
  if (mode === 'both') return bitmap;
  const composed = eyeOf(bitmap, mode === 'right' ? 1 : 0);
  if (mode === 'anaglyph') {
    const right = eyeOf(bitmap, 1);
    keepColor(composed, '#f00');
    keepColor(right, '#0ff');
    const context = composed.getContext('2d');
    if (context) {
      context.globalCompositeOperation = 'lighter';
      context.drawImage(right, 0, 0);
    }
  }
  bitmap.close();
  return composed.transferToImageBitmap();
}

// eye: 0: the left half, 1: the right one.
function eyeOf(bitmap: ImageBitmap, eye: number): OffscreenCanvas {
  const width = Math.max(1, Math.floor(bitmap.width / 2));
  const canvas = new OffscreenCanvas(width, bitmap.height);
  canvas.getContext('2d')?.drawImage(bitmap, -eye * width, 0);
  return canvas;
}

function keepColor(canvas: OffscreenCanvas, color: string) {
  const context = canvas.getContext('2d');
  if (!context) return;
  context.globalCompositeOperation = 'multiply';
  context.fillStyle = color;
  context.fillRect(0, 0, canvas.width, canvas.height);
}
