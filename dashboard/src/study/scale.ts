// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Scales of axes: the position of a value as a fraction of the axis, and the ticks.

import {labelled, ticksOf} from '../log_ticks';

import * as numbers from './numbers';
import type {Maybe} from './numbers';
import {isKnown} from './numbers';

type Words = (value: number) => string;

export interface Tick {
  value: number;
  // Empty for a tick without a label.
  words: string;
}

export interface Scale {
  // From 0 to 1; values outside are drawn at the ends.
  at: (value: number) => number;
  ticks: Tick[];
  // Whether the axis can show the value: a logarithmic axis excludes 0 and below.
  has: (value: Maybe) => value is number;
}

// Margin beyond the highest and lowest value, as a factor.
const MARGIN = 1.25;
// The smallest span of a logarithmic axis, as a factor.
const SPAN_MIN = 4;
// Maximum number of labels on a narrow chart.
const LABELS_MAX = 6;
const LINEAR_STEPS = [1, 2, 5, 10];
const LINEAR_TICKS_MAX = 5;

const clamp = (share: number) => Math.max(0, Math.min(1, share));

// Covers the values that are above 0; `words` formats a tick.
export function logScale(values: Maybe[], words: Words = numbers.tick): Scale {
  const known = values.filter(isKnown).filter((value) => value > 0);
  // reduce, not spread: a call accepts only some thousands of arguments.
  let low = known.reduce((a, b) => Math.min(a, b), Infinity) / MARGIN;
  let high = known.reduce((a, b) => Math.max(a, b), 0) * MARGIN;
  if (!known.length) [low, high] = [1, 10];
  const wider = Math.sqrt(Math.max(1, SPAN_MIN * low / high));
  low /= wider;
  high *= wider;
  const span = Math.log(high / low);
  const ticks = ticksOf(low, high);
  const shown = thinned(labelled(ticks));
  return {
    has: (value): value is number => isKnown(value) && value > 0,
    at: (value) => value > 0 ? clamp(Math.log(value / low) / span) : 0,
    ticks: ticks.map((value) => ({value, words: shown.has(value) ? words(value) : ''})),
  };
}

function thinned(labels: (number|null)[]): Set<number> {
  const known = labels.filter(isKnown);
  const step = Math.ceil(known.length / LABELS_MAX);
  return new Set(known.filter((_, i) => i % step === 0));
}

// Covers the values and 0.
export function linearScale(values: Maybe[], words: Words = numbers.plain): Scale {
  const known = [0, ...values.filter(isKnown)];
  return linearBetween(Math.min(...known), Math.max(...known) || 1, words);
}

export function linearBetween(low: number, high: number, words: Words = numbers.plain): Scale {
  const wish = (high - low) / LINEAR_TICKS_MAX;
  const power = 10 ** Math.floor(Math.log10(wish));
  const step = (LINEAR_STEPS.find((digit) => digit * power >= wish * 0.999) ?? 10) * power;
  const ticks: Tick[] = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; ++i) {
    const value = Number((i * step).toPrecision(12));
    ticks.push({value, words: words(value)});
  }
  return {has: isKnown, at: (value) => clamp((value - low) / (high - low)), ticks};
}
