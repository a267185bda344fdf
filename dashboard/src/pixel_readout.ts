// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The values of the pixel under the cursor: all channels of the image as rendered, linear and
// without exposure, each with its standard error where one is known; and those of the compared
// image. Shift and arrow keys move a cursor from the keyboard. One request runs at a time.

import * as api from './api';
import type {Frame, Pixel, PixelValue} from './api';
import {byId, child, el, setText} from './dom';
import type {ImageViewport} from './image_viewport';
import type {Store} from './store';
import type {Point} from './view_transform';

// Time between the reply and the next request.
const REST_MS = 30;
const DIGITS = 4;
const ATTEMPT = 'reading a pixel';

interface Place {
  x: number;
  y: number;
}

export class PixelReadout {
  private readonly list = byId('pixel-values');
  private place: Place|null = null;
  private asking = false;
  // The pixel that is shown or being asked for.
  private shown = '';

  // shareOf: as EyesChoice.shareOf.
  constructor(
      private readonly store: Store, viewports: readonly ImageViewport[],
      private readonly shareOf: (x: number) => number) {
    for (const viewport of viewports) viewport.onPoint = (point) => this.pointAt(point);
    byId('viewer').addEventListener('keydown', (event) => this.onKey(event));
    for (const topic of ['frames', 'selection', 'beside'] as const) {
      store.listen(topic, () => void this.ask());
    }
  }

  // point: 0 to 1 along each side of the image; null: none.
  private pointAt(point: Point|null) {
    const {frame} = this.store;
    if (!point || !frame) return;
    const {x0_px, y0_px, x1_px, y1_px} = frame.window;
    const at = (low: number, high: number, share: number) =>
        Math.min(high - 1, Math.max(low, low + Math.floor(share * (high - low))));
    this.place = {x: at(x0_px, x1_px, this.shareOf(point.x)), y: at(y0_px, y1_px, point.y)};
    void this.ask();
  }

  private onKey(event: KeyboardEvent) {
    const steps: Record<string, [number, number]> = {
      ArrowLeft: [-1, 0],
      ArrowRight: [1, 0],
      ArrowUp: [0, -1],
      ArrowDown: [0, 1],
    };
    const step = steps[event.key];
    const {frame} = this.store;
    const isImage = (event.target as Element).classList.contains('image-box');
    if (!event.shiftKey || !isImage || !step || !frame) return;
    event.preventDefault();
    const {x0_px, y0_px, x1_px, y1_px} = frame.window;
    const from =
        this.place ?? {x: Math.floor((x0_px + x1_px) / 2), y: Math.floor((y0_px + y1_px) / 2)};
    this.place = {
      x: Math.min(x1_px - 1, Math.max(x0_px, from.x + step[0])),
      y: Math.min(y1_px - 1, Math.max(y0_px, from.y + step[1])),
    };
    void this.ask();
  }

  private async ask() {
    const {frame} = this.store;
    // A layer of the same frame is among its own values.
    const beside = this.store.beside?.name === frame?.name ? undefined : this.store.beside;
    if (!this.place || !frame || frame.preview_version === 0 || this.asking) return;
    const place = {...this.place};
    const key = [
      frame.name, frame.preview_version, beside?.name, beside?.preview_version, place.x, place.y
    ].join();
    if (key === this.shown) return;
    this.shown = key;
    this.asking = true;
    try {
      const [own, other] = await Promise.all(
          [api.getPixel(frame, place.x, place.y), beside ? pixelOf(beside, frame, place) : null]);
      this.store.note(ATTEMPT, null);
      if (this.store.frame?.name === frame.name) this.show(own, other);
    } catch (failure) {
      this.store.note(ATTEMPT, failure);
    }
    setTimeout(() => {
      this.asking = false;
      void this.ask();
    }, REST_MS);
  }

  private show(own: Pixel, other: Pixel|null) {
    const rows = rowsOf(own, other);
    byId('pixel-hint').hidden = true;
    byId('pixel-place').hidden = this.list.hidden = false;
    const compared = other ? '; in brackets: the compared image, and the difference from it' : '';
    setText(
        byId('pixel-place'),
        'Pixel ' + own.x + ', ' + own.y + ': linear values ± standard error' + compared);
    if (this.list.children.length !== rows.length)
      this.list.replaceChildren(...rows.map(() => el('li', {}, el('span'), el('span'))));
    rows.forEach(([name, words], i) => {
      setText(child(child(this.list, i), 0), name);
      setText(child(child(this.list, i), 1), words);
    });
  }
}

// The pixel at the same place of another frame, whose window may begin elsewhere; null if that is
// outside of it.
async function pixelOf(other: Frame, frame: Frame, {x, y}: Place): Promise<Pixel|null> {
  const {window} = other;
  const at = {x: x - frame.window.x0_px + window.x0_px, y: y - frame.window.y0_px + window.y0_px};
  const isInside = at.x < window.x1_px && at.y < window.y1_px;
  return isInside && other.preview_version > 0 ? api.getPixel(other, at.x, at.y) : null;
}

const words = (value: PixelValue) => typeof value === 'number' ?
    String(Number(value.toPrecision(DIGITS))).replace('-', '\u2212') :
    value;

// [channel, value]: "R", "0.18 ± 0.002 (0.19, −0.01)". Color comes first; standard errors stand
// beside their channels.
function rowsOf(own: Pixel, other: Pixel|null): [string, string][] {
  const values = new Map(own.channels.map(({name, value}) => [name, value]));
  const others = new Map((other?.channels ?? []).map(({name, value}) => [name, value]));
  const names = [...values.keys()].filter((name) => !name.startsWith('stderr.'));
  const first = ['R', 'G', 'B', 'samples'];
  const rank = (name: string) => first.includes(name) ? first.indexOf(name) : first.length;
  names.sort((a, b) => rank(a) - rank(b));
  return names.map((name) => {
    const value = values.get(name) ?? 'nan';
    const error = values.get('stderr.' + name);
    const that = others.get(name);
    const bounds = error === undefined ? '' : ' ± ' + words(error);
    const both =
        typeof that === 'number' && typeof value === 'number' ? ', ' + words(value - that) : '';
    return [name, words(value) + bounds + (that === undefined ? '' : ` (${words(that)}${both})`)];
  });
}
