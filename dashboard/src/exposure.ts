// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Requests exposed images from the worker, one at a time; while it works, only the newest request
// waits.

import type {ExposureReply, ExposureRequest} from './exposure_worker';

export const STOPS_MAX = 10;
export const STOPS_STEP = 0.5;

export class Exposure {
  private worker: Worker|null = null;
  private busy = false;
  private waiting: ExposureRequest|null = null;

  constructor(
      private readonly onImage: (key: string, image: ImageBitmap) => void,
      private readonly onFailure: (failure: string) => void) {}

  // `key` is returned with the image. Ownership of `light` is transferred; null means the previous
  // one.
  ask(key: string, light: ImageBitmap|null, stops: number) {
    if (this.waiting?.light && light) this.waiting.light.close();
    this.waiting = {key, light: light ?? this.waiting?.light ?? null, stops};
    this.send();
  }

  private send() {
    if (this.busy || !this.waiting) return;
    this.worker ??= this.start();
    this.worker.postMessage(this.waiting, this.waiting.light ? [this.waiting.light] : []);
    this.waiting = null;
    this.busy = true;
  }

  private start(): Worker {
    const worker = new Worker(new URL('./exposure_worker.ts', import.meta.url), {type: 'module'});
    worker.onmessage = (event: MessageEvent<ExposureReply>) => {
      const {key, image, failure} = event.data;
      this.busy = false;
      if (image)
        this.onImage(key, image);
      else
        this.onFailure(failure);
      this.send();
    };
    worker.onerror = (event) => {
      // The worker sends nothing more; a new worker may succeed with the next image.
      this.onFailure(event.message || 'the script that applies the exposure could not be loaded');
      worker.terminate();
      this.worker = null;
      this.busy = false;
      this.waiting = null;
    };
    return worker;
  }
}
