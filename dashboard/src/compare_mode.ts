// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// How two images are compared: side by side, split at a line that a slider moves, or by their
// difference in false color.

import {byId} from './dom';
import type {Store} from './store';

export type CompareMode = 'beside'|'split'|'difference'|'relative';

export class CompareModeChoice {
  private readonly select = byId<HTMLSelectElement>('compare-mode');
  private readonly slider = byId<HTMLInputElement>('split-at');

  // `onChange` is called when the user chooses another mode.
  constructor(private readonly store: Store, onChange: () => void) {
    this.select.addEventListener('change', () => {
      this.draw();
      onChange();
    });
    this.slider.addEventListener('input', () => this.drawSplit());
  }

  // Side by side while nothing is compared.
  get mode(): CompareMode {
    return this.store.beside ? this.select.value as CompareMode : 'beside';
  }

  get isDifference(): boolean {
    return this.mode === 'difference' || this.mode === 'relative';
  }

  draw() {
    const {mode, store} = this;
    this.select.hidden = !store.beside;
    byId('images').dataset.compare = !store.beside || this.isDifference ? 'no' : mode;
    byId('beside-box').hidden = !store.beside || this.isDifference;
    byId('split').hidden = mode !== 'split';
    this.drawSplit();
  }

  private drawSplit() {
    const {value} = this.slider;
    byId('images').style.setProperty('--split', value + '%');
    this.slider.setAttribute('aria-valuetext', value + ' % from the left');
  }
}
