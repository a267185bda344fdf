// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// How two images are compared: side by side, split at a line that a slider moves, by turns in one
// place, or by their difference in false color.

import {byId, setText} from './dom';
import type {Store} from './store';

export type CompareMode = 'beside'|'split'|'flip'|'difference'|'relative';

export class CompareModeChoice {
  private readonly select = byId<HTMLSelectElement>('compare-mode');
  private readonly slider = byId<HTMLInputElement>('split-at');
  // While images are shown by turns: whether it is the compared one's.
  private flipped = false;

  // `onChange` is called when the user chooses another mode.
  constructor(private readonly store: Store, private readonly onChange: () => void) {
    this.select.addEventListener('change', () => {
      this.draw();
      onChange();
    });
    this.slider.addEventListener('input', () => this.drawSplit());
    byId('flip').addEventListener('click', () => this.flip());
  }

  // Side by side while nothing is compared.
  get mode(): CompareMode {
    return this.store.beside ? this.select.value as CompareMode : 'beside';
  }

  get isDifference(): boolean {
    return this.mode === 'difference' || this.mode === 'relative';
  }

  choose(mode: CompareMode) {
    if (!this.store.beside) return;
    this.select.value = mode;
    this.draw();
    this.onChange();
  }

  // Shows the other image in the same place.
  flip() {
    if (!this.store.beside) return;
    this.flipped = this.mode === 'flip' ? !this.flipped : true;
    if (this.mode !== 'flip') this.select.value = 'flip';
    this.draw();
    this.onChange();
  }

  draw() {
    const {mode, store} = this;
    this.select.hidden = byId('flip').hidden = !store.beside;
    if (mode !== 'flip') this.flipped = false;
    const images = byId('images');
    images.dataset.compare = !store.beside || this.isDifference ? 'no' : mode;
    images.dataset.flipped = this.flipped ? 'yes' : 'no';
    byId('beside-box').hidden = !store.beside || this.isDifference;
    byId('split').hidden = mode !== 'split';
    byId('flip').setAttribute('aria-pressed', String(this.flipped));
    setText(byId('flip'), this.flipped ? 'B' : 'A');
    this.drawSplit();
  }

  private drawSplit() {
    const {value} = this.slider;
    byId('images').style.setProperty('--split', value + '%');
    this.slider.setAttribute('aria-valuetext', value + ' % from the left');
  }
}
