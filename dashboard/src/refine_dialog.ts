// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Asks for the target error of a refinement: a slider of the error of a pixel, with the cost of its
// position on the farm at present. Prices of some errors are fetched, repeatedly while the dialog
// is open; others are interpolated.

import * as api from './api';
import type {Estimate, Job, RefinePrice, RefinePrices} from './api';
import {byId, setText} from './dom';
import * as format from './format';

// Factor in relMSE between the slider's left and right end.
const REACH = 100;
const PRICE_COUNT = 21;
// Slider position for about half the error of a pixel.
const START_SHARE = 0.3;
const PRICE_INTERVAL_MS = 5000;

export class RefineDialog {
  private readonly dialog = byId<HTMLDialogElement>('refine-dialog');
  private readonly slider = byId<HTMLInputElement>('refine-target');
  private job: Job|null = null;
  private prices: RefinePrices|null = null;

  constructor() {
    this.slider.addEventListener('input', () => this.draw());
  }

  // Returns the chosen relMSE; null if the user declined.
  async ask(job: Job): Promise<number|null> {
    if (this.dialog.open || !job.progress.relative_mse) return null;
    this.job = job;
    this.prices = null;
    this.slider.valueAsNumber = START_SHARE * Number(this.slider.max);
    setText(byId('refine-title'), 'Refine “' + (job.title || job.name) + '”');
    this.draw();
    this.dialog.returnValue = 'no';
    this.dialog.showModal();
    void this.fetchPrices(job);
    const timer = setInterval(() => void this.fetchPrices(job), PRICE_INTERVAL_MS);
    await new Promise((resolve) => this.dialog.addEventListener('close', resolve, {once: true}));
    clearInterval(timer);
    this.job = null;
    return this.dialog.returnValue === 'yes' ? targetAt(job, this.share) : null;
  }

  private get share(): number {
    return this.slider.valueAsNumber / Number(this.slider.max);
  }

  private async fetchPrices(job: Job) {
    const targets =
        Array.from({length: PRICE_COUNT}, (_, i) => targetAt(job, i / (PRICE_COUNT - 1)));
    try {
      const prices = await api.getRefinePrices(job.name, targets);
      if (this.job !== job) return;
      this.prices = prices;
      this.draw();
    } catch (failure) {
      if (this.job !== job) return;
      this.prices = null;
      this.draw();
      setText(byId('refine-note'), failure instanceof Error ? failure.message : `${failure}`);
    }
  }

  private draw() {
    if (!this.job) return;
    const target = targetAt(this.job, this.share);
    const words = format.typicalError(target) + ' instead of ' +
        format.typicalError(this.job.progress.relative_mse);
    setText(byId('refine-error'), words + ' (relMSE ' + format.error(target) + ')');
    this.slider.setAttribute('aria-valuetext', words);
    const price = this.prices && priceAt(this.prices.prices, this.share);
    byId<HTMLButtonElement>('refine-yes').disabled = !price || price.cpu_seconds.value <= 0;
    setText(byId('refine-cpu'), price ? bandOf(price.cpu_seconds, format.duration) : '…');
    setText(
        byId('refine-wall'),
        !price                 ? '…' :
            price.wall_seconds ? bandOf(price.wall_seconds, format.duration) :
                                 '–');
    setText(
        byId('refine-samples'),
        price ? bandOf(price.samples_per_pixel, (count) => format.count(count)) : '…');
    setText(byId('refine-note'), this.prices && price ? noteOf(this.prices, price) : 'Pricing …');
  }
}

const targetAt = (job: Job, share: number) => (job.progress.relative_mse ?? 0) * REACH ** -share;

// Interpolates between two known prices, linearly on logarithmic axes.
function priceAt(prices: readonly RefinePrice[], share: number): RefinePrice|null {
  const place = share * (prices.length - 1);
  const below = prices[Math.floor(place)];
  const above = prices[Math.ceil(place)];
  if (!below || !above) return null;
  const between = (a: Estimate, b: Estimate): Estimate => ({
    value: mix(a.value, b.value, place % 1),
    low: mix(a.low, b.low, place % 1),
    high: mix(a.high, b.high, place % 1),
  });
  return {
    target_error: mix(below.target_error, above.target_error, place % 1),
    reached: below.reached && above.reached,
    relative_mse: between(below.relative_mse, above.relative_mse),
    samples_per_pixel: between(below.samples_per_pixel, above.samples_per_pixel),
    cpu_seconds: between(below.cpu_seconds, above.cpu_seconds),
    wall_seconds:
        below.wall_seconds && above.wall_seconds && between(below.wall_seconds, above.wall_seconds),
  };
}

const mix = (a: number, b: number, share: number) =>
    a > 0 && b > 0 ? a ** (1 - share) * b ** share : a + (b - a) * share;

const bandOf = ({value, low, high}: Estimate, words: (value: number) => string) =>
    value > 0 ? words(value) + ' (' + words(low) + ' to ' + words(high) + ')' : 'nothing';

function noteOf(prices: RefinePrices, price: RefinePrice): string {
  if (!price.reached) return 'This error is not expected to be reached with the allowed samples.';
  if (price.cpu_seconds.value <= 0) return 'The images already have at most this error.';
  const {thread_count: threads, jobs_before_count: jobs} = prices;
  const farm = threads === 0 ?
      'No worker is connected.' :
      'On all of the farm’s ' + threads + (threads === 1 ? ' thread' : ' threads') +
          (jobs === 0 ?
               '.' :
               ', including the time of ' + jobs + ' other ' + (jobs === 1 ? 'job.' : 'jobs.'));
  return 'In addition to the cost so far; ranges are 80 % prediction intervals. ' + farm;
}
