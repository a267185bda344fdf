// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The scale of false colors: its legend, and fields for its ends. Each kind of layer keeps the ends
// that were chosen for it. Layers whose colors are directions or ids say what the colors mean.

import {falseColorPath} from './api';
import type {LayerRange} from './api';
import {byId, setText} from './dom';
import * as format from './format';

// Quantities of scales; 'light' is the luminance of a color.
export type Scale = 'error'|'samples'|'time'|'difference'|'relative'|'light'|'value';

const WORDS: Record<Scale, string> = {
  error: 'Standard error of a pixel, relative to its value; logarithmic. Gray: not known yet.',
  samples: 'Samples of a pixel. Gray: none yet.',
  difference: 'Difference from the compared image, root mean square of red, green and blue; ' +
      'logarithmic. Gray: no number.',
  relative: 'The same, relative to the compared image (dark pixels: to a tenth of its mean); ' +
      'logarithmic. Gray: no number.',
  time: 'Processor time of a pixel, the mean over its tile; logarithmic. Gray: not known.',
  light: 'Luminance, linear and before exposure; logarithmic.',
  value: ', linear. Gray: no number.',
};
const KIND_WORDS: Record<string, string> = {
  direction: 'Red, green and blue are x, y and z, from −1 (black) to 1.',
  vector: 'Red, green and blue are x, y and z, each over its range in the image.',
  id: 'Each id has a color of its own. Gray: none.',
};

// Layers in percent are typed in percent.
const unitOf = (scale: Scale) => scale === 'error' || scale === 'relative' ? 100 : 1;
const isLinear = (scale: Scale) => scale === 'samples' || scale === 'value';

export class ScaleLegend {
  private readonly low = byId<HTMLInputElement>('range-low');
  private readonly high = byId<HTMLInputElement>('range-high');
  private readonly chosen = new Map<string, LayerRange>();
  // The shown scale.
  private scale: Scale = 'value';
  private key = '';

  // `onChange` is called when the user has chosen other ends.
  constructor(private readonly onChange: () => void) {
    for (const input of [this.low, this.high])
      input.addEventListener('change', () => this.choose());
    byId('range-auto').addEventListener('click', () => {
      this.chosen.delete(this.key);
      this.onChange();
    });
  }

  // The ends that were chosen; null for those of the values. of: the layer, for values.
  chosenRange(scale: Scale, of: string): LayerRange|null {
    return this.chosen.get(keyOf(scale, of)) ?? null;
  }

  // range: null without false colors. kind: of a layer beside the color, or ''.
  draw(scale: Scale, of: string, kind: string, range: LayerRange|null) {
    const words = range ? wordsOf(scale, of) : KIND_WORDS[kind] ?? '';
    byId('legend').hidden = words === '';
    byId('legend-scale').hidden = byId('range').hidden = range === null;
    setText(byId('legend-words'), words);
    if (!range) return;
    this.scale = scale;
    this.key = keyOf(scale, of);
    const colors = byId<HTMLImageElement>('legend-colors');
    if (!colors.src) colors.src = falseColorPath;
    const value = (at: number) => valueWords(scale, range, at);
    const low = isLinear(scale) ? range.low : Math.max(range.low, range.high * 1e-6);
    const middle = isLinear(scale) ? (low + range.high) / 2 : Math.sqrt(low * range.high);
    const single = range.low === range.high;
    setText(byId('legend-low'), single ? '' : value(range.low));
    setText(byId('legend-middle'), single ? '' : value(middle));
    setText(byId('legend-high'), value(range.high));
    setText(byId('range-unit'), unitOf(scale) === 100 ? '%' : scale === 'time' ? 's' : '');
    byId<HTMLButtonElement>('range-auto').disabled = !this.chosen.has(this.key);
    const fields = [[this.low, range.low], [this.high, range.high]] as const;
    for (const [input, at] of fields) {
      if (document.activeElement === input) continue;
      input.value = String(Number((at * unitOf(scale)).toPrecision(3)));
    }
  }

  private choose() {
    const unit = unitOf(this.scale);
    const [low, high] = [this.low.valueAsNumber / unit, this.high.valueAsNumber / unit];
    const isRange = low < high && (isLinear(this.scale) || low >= 0);
    this.high.setCustomValidity(isRange ? '' : 'The right end must be above the left one.');
    if (!isRange) return void this.high.reportValidity();
    this.chosen.set(this.key, {low, high});
    this.onChange();
  }
}

const keyOf = (scale: Scale, of: string) => scale === 'value' ? 'of:' + of : scale;

function wordsOf(scale: Scale, of: string): string {
  if (scale === 'value') return of + WORDS.value;
  if (scale === 'error' && of)
    return of + ': expected error of a pixel, relative to its value; logarithmic.';
  return scale === 'light' && of ? of + ': ' + WORDS.light : WORDS[scale];
}

function valueWords(scale: Scale, range: LayerRange, value: number): string {
  if (scale === 'value' || scale === 'light') return String(Number(value.toPrecision(3)));
  if (!(range.high > 0)) return scale === 'difference' || scale === 'relative' ? '0' : '–';
  if (scale === 'difference') return String(Number(value.toPrecision(2)));
  if (scale === 'error' || scale === 'relative') return format.share(value);
  return scale === 'time' ? format.shortTime(value) : format.exact(value);
}

// "0.1 % to 20 %"; empty without false colors.
export function rangeWords(scale: Scale, range: LayerRange|null): string {
  if (!range) return '';
  return valueWords(scale, range, range.low) + ' to ' + valueWords(scale, range, range.high);
}
