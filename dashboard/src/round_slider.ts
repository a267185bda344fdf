// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The slider between rounds: selects the round whose final image the viewer shows, or the present
// image at its right end. Its label states the samples and the error of that image.

import type {Frame} from './api';
import {byId, setText} from './dom';
import * as format from './format';

export class RoundSlider {
  private readonly slider = byId<HTMLInputElement>('round');
  private frame: Frame|undefined;
  // Indices in frame.rounds of the rounds with a stored image.
  private kept: number[] = [];
  private chosen: number|null = null;

  // `onChange` is called when the user chooses another round.
  constructor(onChange: () => void) {
    this.slider.addEventListener('input', () => {
      this.chosen = this.kept[this.slider.valueAsNumber] ?? null;
      this.drawWords();
      onChange();
    });
  }

  // Null for the present image.
  get round(): number|null {
    return this.chosen;
  }

  show(frame: Frame|undefined) {
    if (frame?.name !== this.frame?.name) this.chosen = null;
    this.frame = frame;
    this.kept = keptOf(frame);
    if (this.chosen !== null && !this.kept.includes(this.chosen)) this.chosen = null;
    byId('rounds').hidden = this.kept.length === 0;
    const last = this.kept.length;
    if (this.slider.max !== String(last)) this.slider.max = String(last);
    const place = String(this.chosen === null ? last : this.kept.indexOf(this.chosen));
    if (this.slider.value !== place) this.slider.value = place;
    this.drawWords();
  }

  private drawWords() {
    if (!this.frame) return;
    const words = wordsOf(this.frame, this.chosen);
    setText(byId('round-words'), words);
    this.slider.setAttribute('aria-valuetext', words);
  }
}

// The last round of a complete frame is the present image.
function keptOf(frame: Frame|undefined): number[] {
  const rounds = frame?.rounds ?? [];
  return rounds.map((_, i) => i)
      .filter(
          (i) => (rounds[i]?.preview_version ?? 0) > 0 &&
              !(frame?.complete && i === rounds.length - 1));
}

// "Round 2 of 5: 48 samples per pixel, error ±2.1 %".
function wordsOf(frame: Frame, chosen: number|null): string {
  const rounds = frame.rounds;
  const round = chosen === null ? undefined : rounds[chosen];
  const {window} = frame;
  const pixels = (window.x1_px - window.x0_px) * (window.y1_px - window.y0_px);
  const samples = (round?.sample_count ?? frame.progress.sample_count_done) / pixels;
  const error = round ? round.relative_mse : frame.progress.relative_mse;
  const what = chosen === null ? 'Now' : 'Round ' + (chosen + 1) + ' of ' + rounds.length;
  const mean = samples < 10 ? samples.toFixed(1) : format.exact(samples);
  return what + ': ' + mean + ' samples per pixel, error ' + format.typicalError(error || null);
}
