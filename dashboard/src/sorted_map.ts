// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Objects by name, with a fixed order. There may be thousands, and events bring the same ones again
// and again: so they are sorted only when some came or went.

export class SortedMap<Item extends {name: string}> {
  // By name, where each lies in `items`.
  private readonly places = new Map<string, number>();
  private items: Item[] = [];
  private isSorted = true;

  // `compare` may not depend on what changes about an object.
  constructor(private readonly compare: (a: Item, b: Item) => number) {}

  get(name: string): Item|undefined {
    return this.items[this.places.get(name) ?? -1];
  }

  set(item: Item) {
    const place = this.places.get(item.name);
    if (place !== undefined) {
      this.items[place] = item;
      return;
    }
    this.places.set(item.name, this.items.push(item) - 1);
    this.isSorted = false;
  }

  // Forgets all others.
  keepOnly(names: Set<string>) {
    if (this.items.every((item) => names.has(item.name))) return;
    this.arrange(this.items.filter((item) => names.has(item.name)));
  }

  get sorted(): readonly Item[] {
    if (!this.isSorted) this.arrange(this.items.sort(this.compare));
    this.isSorted = true;
    return this.items;
  }

  private arrange(items: Item[]) {
    this.items = items;
    this.places.clear();
    items.forEach((item, place) => this.places.set(item.name, place));
  }
}
