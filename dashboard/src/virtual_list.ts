// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A list or grid of any length that keeps only the visible rows in the document. Rows have one
// height and a grid's cells one width, taken from the style sheet; rows are reused while scrolling.
// The list is one stop of the Tab key; arrow, Home, End and page keys move the selection. A table
// is a list under a row of headings, in which several rows can be chosen.

import {el} from './dom';

// Rows drawn beyond each end of the visible ones, so that fast scrolling shows no gap.
const OVERSCAN = 6;
// Rows made in one animation frame, so that the first layout of a long list is several short tasks.
const ROWS_MADE_MAX = 8;

interface Measured {
  measure(): void;
  redraw(): void;
}

// All lists whose size may have changed are measured before any of them is drawn: a query after a
// change forces the browser to lay out the whole page, once for each list.
const lists = new Map<Element, Measured>();
function measureAll(some: readonly Measured[]) {
  for (const list of some) list.measure();
  for (const list of some) list.redraw();
}
const observer = new ResizeObserver(
    (entries) => measureAll(entries.flatMap(({target}) => lists.get(target) ?? [])));
// A row's height depends on the root font, which depends on the window.
addEventListener('resize', () => measureAll([...lists.values()]));

export interface TableOptions<Item> {
  head: HTMLElement;
  isChosen: (item: Item) => boolean;
  onClick: (index: number, event: MouseEvent) => void;
  // index: of the selected row, or -1. Returns whether the key had an effect.
  onKey: (event: KeyboardEvent, index: number) => boolean;
}

export interface VirtualListOptions<Item> {
  label: string;
  // Name of a style property, in rem.
  rowHeightProperty: string;
  // Likewise. If given, a row holds as many cells as fit.
  cellWidthProperty?: string;
  makeRow: () => HTMLElement;
  updateRow: (row: HTMLElement, item: Item) => void;
  keyOf: (item: Item) => string;
  // If given, items can be selected.
  onSelect?: (item: Item) => void;
  table?: TableOptions<Item>;
}

export class VirtualList<Item> {
  private items: readonly Item[] = [];
  private selectedKey: string|null = null;
  // Item i is in row i modulo their number, so that items that stay visible while scrolling keep
  // their row.
  private readonly rows: HTMLElement[] = [];
  // The item that each row was last drawn with.
  private readonly drawn = new WeakMap<HTMLElement, Item>();
  private readonly space = el('div', {class: 'vlist-space'});
  // In pixels, as last measured; 0 means not measured yet.
  private rowHeight = 0;
  private height = 0;
  private cellWidth = 0;
  private columns = 1;
  private headHeight = 0;
  private scrollTop = 0;
  // Rows were made in this animation frame.
  private growing = false;
  private readonly onSelect: ((item: Item) => void)|undefined;

  constructor(
      private readonly root: HTMLElement, private readonly options: VirtualListOptions<Item>) {
    this.onSelect = options.onSelect;
    root.classList.add('vlist');
    root.tabIndex = 0;
    const {table} = options;
    root.setAttribute('role', table ? 'grid' : this.onSelect ? 'listbox' : 'list');
    root.setAttribute('aria-label', options.label);
    root.replaceChildren(...table ? [table.head] : [], this.space);
    if (table) {
      root.setAttribute('aria-multiselectable', 'true');
      this.space.setAttribute('role', 'rowgroup');
    }
    root.addEventListener('scroll', () => {
      this.scrollTop = root.scrollTop;
      this.draw(true);
    }, {passive: true});
    lists.set(root, this);
    observer.observe(root);
    if (this.onSelect) {
      root.addEventListener('keydown', (event) => this.onKey(event));
      root.addEventListener('click', (event) => this.onClick(event));
    }
  }

  // Reads and changes nothing in the document. Called only after a possible change of size.
  measure() {
    const rem = parseFloat(getComputedStyle(document.documentElement).fontSize);
    const style = getComputedStyle(this.root);
    const {rowHeightProperty, cellWidthProperty} = this.options;
    this.rowHeight = parseFloat(style.getPropertyValue(rowHeightProperty)) * rem;
    this.height = this.root.clientHeight;
    if (cellWidthProperty) {
      this.cellWidth = parseFloat(style.getPropertyValue(cellWidthProperty)) * rem;
      this.columns = Math.max(1, Math.floor(this.root.clientWidth / this.cellWidth));
    }
    this.headHeight = this.options.table?.head.offsetHeight ?? 0;
    this.scrollTop = this.root.scrollTop;
  }

  redraw() {
    this.draw();
  }

  setItems(items: readonly Item[], selectedKey: string|null) {
    this.items = items;
    this.selectedKey = selectedKey;
    this.draw();
  }

  // `scrolled`: only the scroll position has changed since the last call.
  private draw(scrolled = false) {
    // Lets style sheets make a short list no higher than needed.
    const rowCount = Math.ceil(this.items.length / this.columns);
    this.root.style.setProperty('--row-count', String(rowCount));
    if (this.options.table) this.root.setAttribute('aria-rowcount', String(rowCount + 1));
    const height = this.rowHeight;
    if (height === 0) return;
    this.space.style.height = rowCount * height + 'px';
    const overscan = Math.ceil(OVERSCAN / this.columns);
    const visible = Math.ceil(this.height / height) + 2 * overscan;
    // The browser scrolls a list back after it became shorter, but only later.
    const firstMax = Math.max(0, rowCount - visible);
    const firstRow =
        Math.min(firstMax, Math.max(0, Math.floor(this.scrollTop / height) - overscan));
    const first = firstRow * this.columns;
    const last = Math.min(this.items.length, (firstRow + visible) * this.columns);
    this.resizePool(last - first);
    for (let index = first; index < Math.min(last, first + this.rows.length); ++index) {
      const row = this.rows[index % this.rows.length];
      const item = this.items[index];
      if (!row || item === undefined) continue;
      const isDrawn = row.dataset.index === String(index) && this.drawn.get(row) === item;
      if (!scrolled || !isDrawn) this.drawRow(row, item, index, height);
    }
    // The selected row may be scrolled out of sight, and so out of the document.
    if (!this.rows.some((row) => row.dataset.selected === 'yes'))
      this.root.removeAttribute('aria-activedescendant');
  }

  private resizePool(count: number) {
    while (this.rows.length > count) this.rows.pop()?.remove();
    if (this.rows.length >= count || this.growing) return;
    const most = Math.min(count, this.rows.length + ROWS_MADE_MAX);
    while (this.rows.length < most) {
      const row = this.options.makeRow();
      row.classList.add('vlist-row');
      const role = this.options.table ? 'row' : this.onSelect ? 'option' : 'listitem';
      row.setAttribute('role', role);
      this.rows.push(row);
      this.space.append(row);
    }
    this.growing = true;
    requestAnimationFrame(() => {
      this.growing = false;
      this.draw();
    });
  }

  private drawRow(row: HTMLElement, item: Item, index: number, height: number) {
    this.drawn.set(row, item);
    const selected = this.options.keyOf(item) === this.selectedKey;
    row.id = this.root.id + '-' + index;
    row.dataset.index = String(index);
    const x = index % this.columns * this.cellWidth;
    const y = Math.floor(index / this.columns) * height;
    row.style.transform = 'translate(' + x + 'px, ' + y + 'px)';
    const {table} = this.options;
    if (table) {
      row.setAttribute('aria-rowindex', String(index + 2));
      row.setAttribute('aria-selected', String(table.isChosen(item)));
    } else {
      row.setAttribute('aria-setsize', String(this.items.length));
      row.setAttribute('aria-posinset', String(index + 1));
      if (this.onSelect) row.setAttribute('aria-selected', String(selected));
    }
    row.dataset.selected = selected ? 'yes' : 'no';
    if (selected && this.onSelect) this.root.setAttribute('aria-activedescendant', row.id);
    this.options.updateRow(row, item);
  }

  private onClick(event: MouseEvent) {
    const row = (event.target as Element).closest<HTMLElement>('.vlist-row');
    const index = Number(row?.dataset.index);
    const item = row && this.items[index];
    if (!item) return;
    if (this.options.table)
      this.options.table.onClick(index, event);
    else
      this.onSelect?.(item);
  }

  private onKey(event: KeyboardEvent) {
    const at = this.items.findIndex((item) => this.options.keyOf(item) === this.selectedKey);
    if (this.options.table?.onKey(event, at)) return event.preventDefault();
    const row = this.columns;
    const page = row * Math.max(1, Math.floor(this.height / this.rowHeight) - 1);
    const steps: Record<string, number> = {
      ArrowDown: row,
      ArrowUp: -row,
      PageDown: page,
      PageUp: -page,
      Home: -Infinity,
      End: Infinity,
      ...this.options.cellWidthProperty && {ArrowRight: 1, ArrowLeft: -1},
    };
    const step = steps[event.key];
    if (step === undefined || this.items.length === 0) return;
    event.preventDefault();
    const to = Math.max(0, Math.min(this.items.length - 1, at + step));
    const item = this.items[to];
    this.scrollTo(to);
    if (item) this.onSelect?.(item);
  }

  // The selection moved to this row by other means than the list's own keys.
  scrollTo(index: number) {
    const height = this.rowHeight;
    const top = Math.floor(index / this.columns) * height;
    if (top < this.root.scrollTop) this.root.scrollTop = top;
    const bottom = top + height - this.root.clientHeight + this.headHeight;
    if (bottom > this.root.scrollTop) this.root.scrollTop = bottom;
  }
}
