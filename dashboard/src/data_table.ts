// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A table of thousands of rows: headings sort it, and rows are chosen as in a file manager. A
// click chooses one row; with Ctrl, and in the first column, it adds or removes one; with Shift it
// chooses all between. From the keyboard: arrows move, with Shift they also choose; Space adds or
// removes the row, Ctrl+A chooses all, Escape none, and Enter opens the row.

import {child, el, setText} from './dom';
import {VirtualList} from './virtual_list';

// Digits of the longest numbers that are compared as such.
const NUMBER_DIGITS = 12;

export interface Column<Item> {
  name: string;
  // A track of the grid, as in CSS.
  width: string;
  // Left out of narrow windows.
  wide?: boolean;
  makeCell?: () => HTMLElement;
  // Draws into the cell; text is enough for most columns.
  draw?: (cell: HTMLElement, item: Item) => void;
  text?: (item: Item) => string;
  // The column sorts by it; none: it does not.
  key?: (item: Item) => number | string;
}

export interface DataTableOptions<Item> {
  label: string;
  rowHeightProperty: string;
  columns: readonly Column<Item>[];
  // The column that the table is sorted by at first, and whether from high to low.
  sortedBy: string;
  descending: boolean;
  onOpen: (item: Item) => void;
  // The choice of rows has changed.
  onChoice: () => void;
}

export class DataTable<Item extends {name: string}> {
  private readonly list: VirtualList<Item>;
  private readonly heads = new Map<string, HTMLElement>();
  private readonly chosen = new Set<string>();
  private all: readonly Item[] = [];
  private sorted: readonly Item[] = [];
  // The row of the keyboard, and the row from which Shift chooses.
  private active: string|null = null;
  private anchor: string|null = null;
  private sortedBy: string;
  private descending: boolean;

  constructor(root: HTMLElement, private readonly options: DataTableOptions<Item>) {
    this.sortedBy = options.sortedBy;
    this.descending = options.descending;
    root.style.setProperty('--columns', options.columns.map(({width}) => width).join(' '));
    const narrow = options.columns.filter(({wide}) => !wide);
    root.style.setProperty('--columns-narrow', narrow.map(({width}) => width).join(' '));
    this.list = new VirtualList(root, {
      label: options.label,
      rowHeightProperty: options.rowHeightProperty,
      makeRow: () => this.makeRow(),
      updateRow: (row, item) => this.updateRow(row, item),
      keyOf: (item) => item.name,
      onSelect: (item) => this.activate(item, false),
      table: {
        head: this.makeHead(),
        isChosen: (item) => this.chosen.has(item.name),
        onClick: (index, event) => this.onClick(index, event),
        onKey: (event, index) => this.onKey(event, index),
      },
    });
    root.addEventListener('dblclick', (event) => {
      const row = (event.target as Element).closest<HTMLElement>('.vlist-row');
      const item = row && this.sorted[Number(row.dataset.index)];
      if (item) options.onOpen(item);
    });
    this.drawHead();
  }

  // Items that a filter hides are no longer chosen: actions are for rows that one can see.
  setItems(items: readonly Item[]) {
    this.all = items;
    if (this.chosen.size > 0) {
      const names = new Set(items.map(({name}) => name));
      const before = this.chosen.size;
      for (const name of this.chosen)
        if (!names.has(name)) this.chosen.delete(name);
      if (this.chosen.size !== before) this.options.onChoice();
    }
    this.sort();
  }

  get chosenItems(): Item[] {
    return this.sorted.filter(({name}) => this.chosen.has(name));
  }

  chooseNone() {
    this.chosen.clear();
    this.changed();
  }

  private sort() {
    const key = this.options.columns.find(({name}) => name === this.sortedBy)?.key;
    if (!key) {
      this.sorted = this.all;
      return this.draw();
    }
    const sign = this.descending ? -1 : 1;
    const keyed = this.all.map((item, place) => ({item, place, key: sortable(key(item))}));
    keyed.sort((a, b) => a.key < b.key ? -sign : a.key > b.key ? sign : a.place - b.place);
    this.sorted = keyed.map(({item}) => item);
    this.draw();
  }

  private draw() {
    this.list.setItems(this.sorted, this.active);
  }

  private changed() {
    this.draw();
    this.options.onChoice();
  }

  private makeHead(): HTMLElement {
    const head = el('div', {class: 'table-row table-head', role: 'row', 'aria-rowindex': '1'});
    for (const {name, key, wide} of this.options.columns) {
      const button = el('button', {class: 'sort', type: 'button'}, name);
      const cell =
          el('div', {role: 'columnheader', class: wide ? 'cell wide' : 'cell'},
             ...key ? [button] : [el('span', {class: 'visually-hidden'}, name)]);
      if (key) button.addEventListener('click', () => this.sortBy(name));
      this.heads.set(name, cell);
      head.append(cell);
    }
    return head;
  }

  private sortBy(name: string) {
    this.descending = this.sortedBy === name && !this.descending;
    this.sortedBy = name;
    this.drawHead();
    this.sort();
  }

  private drawHead() {
    for (const [name, cell] of this.heads) {
      if (name === this.sortedBy)
        cell.setAttribute('aria-sort', this.descending ? 'descending' : 'ascending');
      else
        cell.removeAttribute('aria-sort');
    }
  }

  private makeRow(): HTMLElement {
    return el('div', {class: 'table-row'}, ...this.options.columns.map(({makeCell, wide}) => {
      const cell = makeCell?.() ?? el('div');
      cell.className = ('cell ' + (wide ? 'wide ' : '') + cell.className).trim();
      cell.setAttribute('role', 'gridcell');
      return cell;
    }));
  }

  private updateRow(row: HTMLElement, item: Item) {
    this.options.columns.forEach(({draw, text}, i) => {
      const cell = child(row, i);
      if (draw) return draw(cell, item);
      const words = text?.(item) ?? '';
      setText(cell, words);
      if (cell.title !== words) cell.title = words;
    });
  }

  private activate(item: Item, extends_: boolean) {
    this.active = item.name;
    if (!extends_) {
      this.chosen.clear();
      this.chosen.add(item.name);
      this.anchor = item.name;
    }
    this.changed();
  }

  private onClick(index: number, event: MouseEvent) {
    const item = this.sorted[index];
    if (!item) return;
    const isTick = (event.target as Element).closest('.cell-tick') !== null;
    if (event.shiftKey)
      this.chooseTo(index);
    else if (isTick || event.ctrlKey || event.metaKey)
      this.toggle(item);
    else
      this.activate(item, false);
  }

  private toggle(item: Item) {
    if (!this.chosen.delete(item.name)) this.chosen.add(item.name);
    this.active = this.anchor = item.name;
    this.changed();
  }

  // All rows from the anchor to this one.
  private chooseTo(index: number) {
    const item = this.sorted[index];
    if (!item) return;
    const from = this.sorted.findIndex(({name}) => name === this.anchor);
    const [low, high] = from < 0 ? [index, index] : [Math.min(from, index), Math.max(from, index)];
    this.chosen.clear();
    for (const {name} of this.sorted.slice(low, high + 1)) this.chosen.add(name);
    this.anchor ??= item.name;
    this.active = item.name;
    this.changed();
  }

  private onKey(event: KeyboardEvent, index: number): boolean {
    if ((event.target as Element).closest('.sort')) return false;
    const item = this.sorted[index];
    if (event.key === 'Enter' && item) {
      this.options.onOpen(item);
      return true;
    }
    if (event.key === ' ' && item) {
      this.toggle(item);
      return true;
    }
    if (event.key === 'a' && (event.ctrlKey || event.metaKey)) {
      for (const {name} of this.sorted) this.chosen.add(name);
      this.changed();
      return true;
    }
    if (event.key === 'Escape' && this.chosen.size > 0) {
      this.chooseNone();
      return true;
    }
    const step = event.key === 'ArrowDown' ? 1 : event.key === 'ArrowUp' ? -1 : 0;
    if (!event.shiftKey || step === 0) return false;
    const to = Math.max(0, Math.min(this.sorted.length - 1, index + step));
    this.list.scrollTo(to);
    this.chooseTo(to);
    return true;
  }
}

// Numbers in texts count as numbers: node2 comes before node10.
const sortable = (key: number|string) => typeof key === 'number' ?
    key :
    key.replace(/\d+/g, (digits) => digits.padStart(NUMBER_DIGITS, '0'));

// The column in which a click adds or removes the row.
export function tickColumn<Item>(): Column<Item> {
  return {
    name: 'Chosen',
    width: '2rem',
    makeCell: () => el('div', {class: 'cell-tick'}, el('span', {class: 'tick'})),
    draw: () => {},
  };
}
