// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Ticks of logarithmic axes, and the choice of those that get a label.

// If the ends of an axis have at least this ratio, only powers of ten are labeled.
const DECADES_RATIO = 30;
// Maximum number of decades with ticks.
const DECADES_MAX = 24;

// 1 to 9 times each power of ten from `low` to `high`. The chart library's own ticks require an
// axis that begins at a power of ten, and never terminate for some others.
export function ticksOf(low: number, high: number): number[] {
  const ticks: number[] = [];
  const last = Math.min(Math.floor(Math.log10(high)), Math.floor(Math.log10(low)) + DECADES_MAX);
  for (let power = Math.floor(Math.log10(low)); power <= last; ++power) {
    for (let digit = 1; digit < 10; ++digit) {
      const tick = Number(digit + 'e' + power);
      if (tick >= low && tick <= high) ticks.push(tick);
    }
  }
  return ticks;
}

// The given ticks; null replaces those without room for a label.
export function labelled(ticks: number[]): (number|null)[] {
  const [low, high] = [ticks[0] ?? 1, ticks.at(-1) ?? 1];
  const digits = high / low >= DECADES_RATIO ? [1] : [1, 2, 5];
  return ticks.map((tick) => {
    const leading = Math.round(tick / 10 ** Math.floor(Math.log10(tick) + 1e-9));
    return digits.includes(leading) ? tick : null;
  });
}
