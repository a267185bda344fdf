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
// An axis of times has finer ticks, if it would otherwise have fewer labels.
const LABELS_MIN = 3;
const TIME_UNITS: [string, number, string][] = [
  ['\u00b5s', 1e-6, 'thousand'],
  ['ms', 1e-3, 'thousand'],
  ['s', 1, 'sixty'],
  ['min', 60, 'sixty'],
  ['h', 3600, 'day'],
  ['d', 86400, 'thousand'],
];
// Numbers of a unit, up to the next one.
const ROUND: Record<string, number[]> = {
  thousand: [1, 2, 5, 10, 20, 50, 100, 200, 500],
  sixty: [1, 2, 5, 10, 20, 30],
  day: [1, 2, 5, 10],
};
const FINE: Record<string, number[]> = {
  thousand: [1, 1.5, 2, 3, 4, 5, 7, 10, 15, 20, 30, 40, 50, 70, 100, 150, 200, 300, 400, 500, 700],
  sixty: [1, 1.5, 2, 3, 4, 5, 7, 10, 15, 20, 25, 30, 40, 50],
  day: [1, 1.5, 2, 3, 4, 5, 7, 10, 15, 20],
};
// Leading digits of the labels of errors; the first that are not too many are used.
const ERROR_DIGITS = [[1, 2, 5], [1, 3], [1]];
const LINEAR_STEPS = [1, 2, 5, 10];
const LINEAR_TICKS_MAX = 5;

const clamp = (share: number) => Math.max(0, Math.min(1, share));

// Ends of a logarithmic axis for the values that are above 0.
function rangeOf(values: Maybe[]): [number, number] {
  const known = values.filter(isKnown).filter((value) => value > 0);
  if (!known.length) return [1, 10];
  // reduce, not spread: a call accepts only some thousands of arguments.
  const low = known.reduce((a, b) => Math.min(a, b), Infinity) / MARGIN;
  const high = known.reduce((a, b) => Math.max(a, b), 0) * MARGIN;
  const wider = Math.sqrt(Math.max(1, SPAN_MIN * low / high));
  return [low / wider, high * wider];
}

function logBetween(low: number, high: number, ticks: Tick[]): Scale {
  const span = Math.log(high / low);
  return {
    has: (value): value is number => isKnown(value) && value > 0,
    at: (value) => value > 0 ? clamp(Math.log(value / low) / span) : 0,
    ticks,
  };
}

// Covers the values that are above 0; `words` formats a tick.
export function logScale(values: Maybe[], words: Words = numbers.tick): Scale {
  const [low, high] = rangeOf(values);
  const ticks = ticksOf(low, high);
  const shown = thinned(labelled(ticks));
  return logBetween(
      low, high, ticks.map((value) => ({value, words: shown.has(value) ? words(value) : ''})));
}

// Covers the relMSE that are above 0; ticks are round errors of a pixel, their roots.
export function errorScale(values: Maybe[]): Scale {
  const [low, high] =
      rangeOf(values.map((value) => isKnown(value) && value > 0 ? Math.sqrt(value) : null));
  const roots = ticksOf(low, high);
  const digits = ERROR_DIGITS.find((set) => countOf(roots, set) <= LABELS_MAX) ?? [1];
  return logBetween(
      low ** 2, high ** 2,
      roots.map((root) => ({
                  value: root ** 2,
                  words: digits.includes(leadingOf(root)) ? numbers.errorTick(root) : '',
                })));
}

const leadingOf = (value: number) => Math.round(value / 10 ** Math.floor(Math.log10(value) + 1e-9));

const countOf = (ticks: number[], digits: number[]) =>
    ticks.filter((tick) => digits.includes(leadingOf(tick))).length;

// Covers times in seconds; ticks are round in the unit that they are written in.
export function timeScale(values: Maybe[]): Scale {
  const [low, high] = rangeOf(values);
  const inside = (factors: Record<string, number[]>) =>
      TIME_UNITS
          .flatMap(([unit, size, kind]) => (factors[kind] ?? []).map((factor) => ({
                                                                       value: factor * size,
                                                                       words: factor + ' ' + unit,
                                                                     })))
          .filter(({value}) => value >= low && value <= high);
  const round = inside(ROUND);
  const ticks = round.length >= LABELS_MIN ? round : inside(FINE);
  const step = Math.ceil(ticks.length / LABELS_MAX);
  return logBetween(
      low, high, ticks.map(({value, words}, i) => ({value, words: i % step === 0 ? words : ''})));
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
