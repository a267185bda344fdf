// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Formats measured numbers for people. Unknown values are dashes.

import * as format from '../format';

export type Maybe = number|null|undefined;

const UNKNOWN = '–';
const MINUS = '\u2212';
const SUPERSCRIPTS = '⁰¹²³⁴⁵⁶⁷⁸⁹';
// Smaller numbers are written with a power of ten.
const PLAIN_MIN = 1e-3;
const PLAIN_MAX = 1e5;
// Maximum number of digits of a number with an error.
const DIGITS_MAX = 5;

export const isKnown = (value: Maybe): value is number =>
    typeof value === 'number' && Number.isFinite(value);

// The power of ten of a number's first digit. Requires: value is not 0.
const powerOf = (value: number) => Math.floor(Math.log10(Math.abs(value)) + 1e-12);

const withMinus = (text: string) => text.replace('-', MINUS);

// -5 -> "10⁻⁵".
export function tenTo(power: number): string {
  const digits = [...String(Math.abs(power))].map((digit) => SUPERSCRIPTS[Number(digit)]).join('');
  return '10' + (power < 0 ? '⁻' : '') + digits;
}

// Tick of a logarithmic axis: 0.0002 -> "2·10⁻⁴", 0.1 -> "10⁻¹".
export function powerTick(value: number): string {
  const power = powerOf(value);
  const leading = Math.round(value / 10 ** power);
  return (leading === 1 ? '' : leading + '·') + tenTo(power);
}

// The same, but plain if that is short: 0.05 -> "0.05".
export const tick = (value: number) =>
    value >= 0.01 && value < 1e4 ? String(Number(value.toPrecision(2))) : powerTick(value);

// "0.0123", "1.23·10⁻⁵": three significant digits.
export function plain(value: Maybe): string {
  if (!isKnown(value)) return UNKNOWN;
  if (value === 0) return '0';
  const size = Math.abs(value);
  if (size >= PLAIN_MIN && size < PLAIN_MAX) return withMinus(String(Number(value.toPrecision(3))));
  const power = powerOf(value);
  return withMinus((value / 10 ** power).toFixed(2)) + '·' + tenTo(power);
}

// "1.20 ± 0.10", "(1.23 ± 0.02)·10⁻⁵": as many digits as the error makes significant.
export function measured(value: Maybe, error: Maybe): string {
  if (!isKnown(value)) return UNKNOWN;
  if (!isKnown(error) || !(error > 0)) return plain(value);
  const size = Math.max(Math.abs(value), error);
  const isPlain = size >= PLAIN_MIN && size < PLAIN_MAX;
  const power = isPlain ? 0 : powerOf(size);
  const scale = 10 ** power;
  const digits = Math.max(0, 1 - powerOf(error / scale));
  // An error this far below its number is negligible, so it is not shown.
  if (digits + powerOf(size / scale) >= DIGITS_MAX) return plain(value);
  const text = withMinus((value / scale).toFixed(digits)) + ' ± ' + (error / scale).toFixed(digits);
  return isPlain ? text : '(' + text + ')·' + tenTo(power);
}

// "12.3 %", "0.12 %", "−1.0 %".
export function share(value: Maybe): string {
  if (!isKnown(value)) return UNKNOWN;
  const percent = 100 * value;
  const size = Math.abs(percent);
  return withMinus(percent.toFixed(size >= 10 || size < 0.005 ? 0 : size >= 1 ? 1 : 2)) + ' %';
}

export function measuredShare(value: Maybe, error: Maybe): string {
  if (!isKnown(value)) return UNKNOWN;
  if (!isKnown(error) || !(error > 0)) return share(value);
  return measured(100 * value, 100 * error) + ' %';
}

// "1.2 ×".
export const times = (value: Maybe) => isKnown(value) ? plain(value) + ' ×' : UNKNOWN;

export const count = (value: Maybe) => isKnown(value) ? format.exact(value) : UNKNOWN;

// Samples per pixel: an integer, or the mean if tiles differ: "16", "12.7".
export const samples = (value: number) => Number.isInteger(value) ? count(value) : plain(value);

// "12 ms", "1.23 s", "3 min 20 s".
export function time(seconds: Maybe): string {
  if (!isKnown(seconds)) return UNKNOWN;
  if (seconds === 0) return '0 s';
  if (seconds < 1) return format.shortTime(seconds);
  return seconds < 60 ? Number(seconds.toPrecision(3)) + ' s' : format.duration(seconds);
}

// The typical error of a pixel for a relMSE: "±3.2 %".
export const typicalError = (relativeMse: Maybe) =>
    isKnown(relativeMse) && relativeMse >= 0 ? format.typicalError(relativeMse) : UNKNOWN;

// Tick of an axis of errors of a pixel: 0.02 -> "±2 %".
export const errorTick = (error: number) => '±' + Number((100 * error).toPrecision(2)) + ' %';

// A relMSE with its standard error, as errors of a pixel: "±3.2 % (3.1 to 3.3)".
export function measuredError(relativeMse: Maybe, error: Maybe): string {
  const words = typicalError(relativeMse);
  if (!isKnown(relativeMse) || !isKnown(error) || !(error > 0) || error >= relativeMse)
    return words;
  const percent = (value: number) => typicalError(value).slice(1, -2);
  return words + ` (${percent(relativeMse - error)} to ${percent(relativeMse + error)})`;
}

// Label of an axis: 0.25 -> "25 %".
export const roundShare = (value: number) =>
    withMinus(String(Number((100 * value).toPrecision(3)))) + ' %';
