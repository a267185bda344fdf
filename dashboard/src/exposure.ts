// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Requests exposed images and histograms from a worker. One request is on its way at a time, and
// only the latest waiting one is kept, so that a fast slider does not build up a queue.

import type {LayerRange} from './api';
import type {ExposureReply, ExposureRequest} from './exposure_worker';
import type {Histogram} from './light_bins';

export const STOPS_MAX = 10;
export const STOPS_STEP = 0.5;

// How light is shown.
export interface Development {
  stops: number;
  // Luminance in false color over this range; 'auto' for that of most pixels, null for colors.
  falseColor: LayerRange|'auto'|null;
  // Whether the histogram is wanted.
  count: boolean;
}

export interface ExposureAnswers {
  onImage: (key: string, image: ImageBitmap, range: LayerRange|null) => void;
  onHistogram: (key: string, histogram: Histogram) => void;
  onFailure: (failure: string) => void;
}

export class Exposure {
  private worker: Worker|null = null;
  private busy = false;
  private waiting: ExposureRequest|null = null;

  constructor(private readonly answers: ExposureAnswers) {}

  // `key` is returned with the image. Ownership of `light` is transferred; null means the previous
  // one.
  ask(key: string, light: ImageBitmap|null, development: Development) {
    const {waiting} = this;
    waiting?.palette?.close();
    if (light) waiting?.light?.close();
    this.waiting = {key, light: light ?? waiting?.light ?? null, palette: null, ...development};
    this.send();
  }

  // Asks only for the histogram of an image in false color. Ownership is transferred.
  askPalette(key: string, palette: ImageBitmap) {
    this.waiting?.light?.close();
    this.waiting?.palette?.close();
    this.waiting = {key, light: null, palette, stops: 0, falseColor: null, count: true};
    this.send();
  }

  private send() {
    if (this.busy || !this.waiting) return;
    this.worker ??= this.start();
    const {light, palette} = this.waiting;
    this.worker.postMessage(this.waiting, [light, palette].filter((one) => one !== null));
    this.waiting = null;
    this.busy = true;
  }

  private start(): Worker {
    const worker = new Worker(new URL('./exposure_worker.ts', import.meta.url), {type: 'module'});
    worker.onmessage = (event: MessageEvent<ExposureReply>) => {
      const {key, image, range, histogram, failure} = event.data;
      this.busy = false;
      if (histogram) this.answers.onHistogram(key, histogram);
      if (image)
        this.answers.onImage(key, image, range);
      else if (failure)
        this.answers.onFailure(failure);
      this.send();
    };
    worker.onerror = (event) => {
      // The worker sends nothing more; a new worker may succeed with the next image.
      this.answers.onFailure(
          event.message || 'the script that applies the exposure could not be loaded');
      worker.terminate();
      this.worker = null;
      this.busy = false;
      this.waiting = null;
    };
    return worker;
  }
}
