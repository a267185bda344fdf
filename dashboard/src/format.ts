// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Formats numbers, times and names for people.

import type {Job, Progress, Rect} from './api';

const SUFFIXES = ['', 'k', 'M', 'G', 'T', 'P'];

// 1234567 -> "1.23 M".
export function count(value: number): string {
  let scaled = value;
  let index = 0;
  while (Math.abs(scaled) >= 999.5 && index < SUFFIXES.length - 1) {
    scaled /= 1000;
    index += 1;
  }
  const digits = index === 0 ? 0 : scaled < 9.995 ? 2 : scaled < 99.95 ? 1 : 0;
  return scaled.toFixed(digits) + (index ? ' ' + SUFFIXES[index] : '');
}

// 1536000 -> "1.54 MB".
export const bytes = (value: number) => count(value) + (value < 999.5 ? ' B' : 'B');

// "32, 0": the first pixel of a tile.
export const place = (rect: Rect) => rect.x0_px + ', ' + rect.y0_px;

// Exact, with thin spaces between thousands.
export function exact(value: number): string {
  return Math.round(value).toString().replace(/\B(?=(\d{3})+$)/g, '\u2009');
}

export function percent(share: number): string {
  return (share >= 1 ? 100 : Math.floor(share * 1000) / 10).toFixed(share >= 1 ? 0 : 1) + ' %';
}

// The same without trailing zeros, for axes: 1e7 -> "10 M".
export const roundCount = (value: number) => count(value).replace(/\.0+(?= )/, '');

// Two digits below 10, for axes: 0.25 -> "0.25", 64 -> "64", 1e7 -> "10 M".
export const roundNumber = (value: number) =>
    value < 10 ? String(Number(value.toPrecision(2))) : roundCount(value);

// 0.05 -> "5 %", 0.00123 -> "0.12 %": two significant digits.
export function share(value: number): string {
  return Number((value * 100).toPrecision(2)) + ' %';
}

// A zoom: screen pixels per image pixel.
export function zoom(scale: number): string {
  const percent = scale * 100;
  return (percent < 10 ? percent.toFixed(1) : Math.round(percent)) + ' %';
}

// With a sign, for an exposure or a priority: "+1.5", "0", "−2".
export function signed(value: number): string {
  return (value > 0 ? '+' : value < 0 ? '\u2212' : '') + Math.abs(value);
}

// With a typographic minus: "-0.3" -> "−0.3", "-0.0" -> "0.0".
export const signedNumber = (digits: string) =>
    Number(digits) === 0 ? digits.replace('-', '') : digits.replace('-', '\u2212');

// 3725 -> "1 h 02 min": only the two leading units.
export function duration(seconds: number|null): string {
  if (seconds === null) return '–';
  if (seconds < 10) return seconds.toFixed(1) + ' s';
  const whole = Math.round(seconds);
  if (whole < 60) return whole + ' s';
  const two = (n: number) => String(n).padStart(2, '0');
  if (whole < 3600) return Math.floor(whole / 60) + ' min ' + two(whole % 60) + ' s';
  if (whole < 86400)
    return Math.floor(whole / 3600) + ' h ' + two(Math.floor(whole / 60) % 60) + ' min';
  return Math.floor(whole / 86400) + ' d ' + two(Math.floor(whole / 3600) % 24) + ' h';
}

// Time per pixel: 0.00034 -> "340 µs".
export function shortTime(seconds: number): string {
  const [factor, unit] = seconds < 1e-3 ? [1e6, ' µs'] : seconds < 1 ? [1e3, ' ms'] : [1, ' s'];
  return Number((seconds * factor).toPrecision(2)) + unit;
}

// One unit with two digits, for axes: 100 -> "1.7 min".
export function roundDuration(seconds: number): string {
  const units: [number, string][] = [[86400, ' d'], [3600, ' h'], [60, ' min']];
  const [size, unit] = units.find(([size]) => seconds >= 1.5 * size) ?? [1, ' s'];
  return Number((seconds / size).toPrecision(2)) + unit;
}

// A relative mean squared error as the typical error of a pixel, which is its root.
export function error(relativeMse: number|null): string {
  if (relativeMse === null) return '–';
  return relativeMse.toExponential(2).replace('e-', 'e\u2212').replace('e+', 'e');
}

export function typicalError(relativeMse: number|null): string {
  if (relativeMse === null) return '–';
  const share = Math.sqrt(relativeMse) * 100;
  return '±' +
      (share < 1      ? share.toFixed(2) :
           share < 10 ? share.toFixed(1) :
                        share.toFixed(0)) +
      ' %';
}

let clockOfToday: Intl.DateTimeFormat|undefined;
let calendar: Intl.DateTimeFormat|undefined;

// "12:34:56" for today, otherwise with the date.
export function clock(iso: string|null): string {
  if (!iso) return '–';
  const time = new Date(iso);
  const today = time.toDateString() === new Date().toDateString();
  // Created at first use and kept, since creating it is far slower than using it.
  clockOfToday ??= new Intl.DateTimeFormat(undefined, {timeStyle: 'medium'});
  calendar ??= new Intl.DateTimeFormat(undefined, {dateStyle: 'short', timeStyle: 'medium'});
  return (today ? clockOfToday : calendar).format(time);
}

let shortClock: Intl.DateTimeFormat|undefined;
let shortCalendar: Intl.DateTimeFormat|undefined;

// The same without seconds, for columns.
export function shortTimeOfDay(iso: string|null): string {
  if (!iso) return '–';
  const time = new Date(iso);
  const today = time.toDateString() === new Date().toDateString();
  shortClock ??= new Intl.DateTimeFormat(undefined, {timeStyle: 'short'});
  shortCalendar ??= new Intl.DateTimeFormat(undefined, {dateStyle: 'short', timeStyle: 'short'});
  return (today ? shortClock : shortCalendar).format(time);
}

// Time elapsed since a point in time, in words.
export function ago(iso: string|null): string {
  if (!iso) return 'never';
  const seconds = Math.max(0, (Date.now() - new Date(iso).getTime()) / 1000);
  return seconds < 2 ? 'now' : duration(seconds) + ' ago';
}

// "jobs/7" -> "7".
export const shortName = (name: string) => name.slice(name.lastIndexOf('/') + 1);

// Whether the job is in a final state.
export const hasEnded = (job: Job) => ['succeeded', 'failed', 'cancelled'].includes(job.state);

// Compares jobs for Array.sort. ISO times in UTC compare as text.
export const newestFirst = (a: Job, b: Job) =>
    Number(a.create_time < b.create_time) - Number(a.create_time > b.create_time);

// Fraction of the samples that are merged, 0 to 1.
export function doneShare(progress: Progress): number {
  return progress.sample_count_total > 0 ?
      progress.sample_count_done / progress.sample_count_total :
      0;
}
