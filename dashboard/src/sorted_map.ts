// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Objects by name in a fixed order. There may be thousands, and events update the same ones
// repeatedly; they are therefore sorted only after additions or removals.

export class SortedMap<Item extends {name: string}> {
  // Index in `items` by name.
  private readonly places = new Map<string, number>();
  private items: Item[] = [];
  private isSorted = true;

  // `compare` must not depend on properties that change.
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

  // Removes all others.
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
