// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Which curves the chart of errors shows: a few at once, each with a color of its own.

import {isKnown} from './numbers';
import type {Entry} from './schema';

// More curves than this cannot be told apart.
export const SHOWN_MAX = 5;

// The base, then settings with a flag that render the same image, then biased ones with a flag,
// then the rest; the larger gain first.
function rankOf({is_base, is_unbiased, flag}: Entry): number {
  if (is_base) return 0;
  if (!flag) return 3;
  return is_unbiased ? 1 : 2;
}

// The indices of the entries to show first.
export function firstShown(entries: Entry[]): number[] {
  const gainOf = (entry?: Entry) => isKnown(entry?.gain?.value) ? entry.gain.value : 0;
  return entries.map((_, i) => i)
      .filter((i) => entries[i]?.points.length)
      .sort((a, b) => {
        const [x, y] = [entries[a], entries[b]];
        return x && y ? rankOf(x) - rankOf(y) || gainOf(y) - gainOf(x) : 0;
      })
      .slice(0, SHOWN_MAX);
}

// Colors in use, by entry. Invariant: at most SHOWN_MAX entries have one, and no two the same.
export class ColorSlots {
  private readonly slots = new Map<number, number>();

  isFull(): boolean {
    return this.slots.size >= SHOWN_MAX;
  }
  // Undefined for an entry that is not shown.
  slotOf(index: number): number|undefined {
    return this.slots.get(index);
  }
  // Shows the entry, unless all colors are in use.
  add(index: number) {
    if (this.isFull() || this.slots.has(index)) return;
    const used = new Set(this.slots.values());
    let slot = 0;
    while (used.has(slot)) ++slot;
    this.slots.set(index, slot);
  }
  remove(index: number) {
    this.slots.delete(index);
  }
}
