// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Costs and gains of the effects of the selected job's scene, if the submitter measured them, with
// bars of their fractions of the time.

import type {EffectCost} from './api';
import {byId, child, el, setText} from './dom';
import * as format from './format';
import type {Store} from './store';

// A share below 0 by more than this many standard errors is not due to chance.
const ERRORS_OF_CHANCE = 2;

export class EffectsView {
  private shown: readonly EffectCost[] = [];

  constructor(private readonly store: Store) {
    for (const topic of ['effects', 'selection'] as const) store.listen(topic, this.draw);
  }

  private readonly draw = () => {
    const {effects} = this.store;
    byId('effects-section').hidden = !this.store.job;
    byId('effects-empty').hidden = effects.length > 0;
    for (const id of ['effects', 'effects-legend']) byId(id).hidden = effects.length === 0;
    if (effects === this.shown) return;
    this.shown = effects;
    byId('effects').replaceChildren(...effects.map(makeRow));
  };
}

function makeRow(effect: EffectCost): HTMLElement {
  const row =
      el('li', {class: 'effect'}, el('span', {class: 'effect-name'}),
         el('div', {class: 'effect-bar', 'aria-hidden': 'true'}, el('div', {class: 'effect-fill'}),
            el('div', {class: 'effect-error'})),
         el('span', {class: 'effect-words'}));
  setText(child(row, 0), effect.name);
  row.title = effect.problem || 'Ablated scene: ' + effect.ablation;
  const {time_fraction: share, time_fraction_error: error} = effect;
  const bar = child(row, 1);
  child(bar, 0).style.width = percentOf(share);
  child(bar, 1).style.left = percentOf(share - error);
  child(bar, 1).style.right = percentOf(1 - share - error);
  bar.hidden = effect.problem !== '';
  setText(child(row, 2), effect.problem ? 'not measured: ' + effect.problem : wordsOf(effect));
  return row;
}

const percentOf = (share: number) => (100 * Math.max(0, Math.min(1, share))).toFixed(2) + '%';

// "31 ± 2 % of the time; 12 ± 0.5 % of the light; variance × 1.3". Shares lie between 0 and 100 %:
// a value below 0 by more than chance is a saving, and the text says so.
function wordsOf(effect: EffectCost): string {
  // 0 if unknown.
  const ratio = effect.variance_ratio;
  const noise = ratio > 0 ? '; variance × ' + Number(ratio.toPrecision(2)) : '';
  const {time_fraction: time, time_fraction_error: timeError} = effect;
  const {mean_change: change, mean_change_error: changeError} = effect;
  return shareWords(time, timeError, 'of the time', 'saves ') + '; ' +
      shareWords(-change, changeError, 'of the light', 'removes ') + noise;
}

function shareWords(share: number, error: number, what: string, below: string): string {
  if (share >= 0) return withError(Math.min(1, share), error) + ' ' + what;
  if (share < -ERRORS_OF_CHANCE * error) return below + withError(-share, error) + ' ' + what;
  return 'nothing measurable ' + what + ' (± ' + format.share(error) + ')';
}

// Rounded to the first uncertain digit.
function withError(share: number, error: number): string {
  const digits = error > 0 ? Math.max(0, Math.min(3, -Math.floor(Math.log10(100 * error)))) : 1;
  // "100 ± 0.0 %" claims more than was measured.
  if (share > 0.995) return 'all';
  const words = (value: number) => format.signedNumber((100 * value).toFixed(digits));
  return words(share) + ' ± ' + (100 * error).toFixed(digits) + ' %';
}
