// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A list of any length that keeps only the visible rows in the document. Rows have one height,
// taken from the style sheet, and are reused while scrolling. It is one stop of the Tab key;
// arrows, Home, End and the page keys move the selection.

import {el} from './dom.js';

// Rows drawn beyond the visible ones at each end, so that a quick scroll shows no gap.
const OVERSCAN = 6;

export class VirtualList {
  // makeRow() returns an element; updateRow(element, item) fills it; onSelect(item) is optional.
  constructor(root, {label, rowHeightProperty, makeRow, updateRow, keyOf, onSelect}) {
    Object.assign(this, {root, makeRow, updateRow, keyOf, onSelect, rowHeightProperty});
    this.items = [];
    this.selectedKey = null;
    this.rows = [];
    this.space = el('div', {class: 'vlist-space'});
    root.classList.add('vlist');
    root.tabIndex = 0;
    root.setAttribute('role', onSelect ? 'listbox' : 'list');
    root.setAttribute('aria-label', label);
    root.replaceChildren(this.space);
    root.addEventListener('scroll', () => this.draw(), {passive: true});
    new ResizeObserver(() => this.draw()).observe(root);
    if (onSelect) {
      root.addEventListener('keydown', (event) => this.onKey(event));
      root.addEventListener('click', (event) => this.onClick(event));
    }
  }

  get rowHeight() {
    const rem = parseFloat(getComputedStyle(document.documentElement).fontSize);
    return parseFloat(getComputedStyle(this.root).getPropertyValue(this.rowHeightProperty)) * rem;
  }

  setItems(items, selectedKey) {
    this.items = items;
    this.selectedKey = selectedKey;
    this.draw();
  }

  draw() {
    const height = this.rowHeight;
    this.space.style.height = this.items.length * height + 'px';
    // For style sheets that make a short list no higher than it needs.
    this.root.style.setProperty('--row-count', this.items.length);
    const first = Math.max(0, Math.floor(this.root.scrollTop / height) - OVERSCAN);
    const visible = Math.ceil(this.root.clientHeight / height) + 2 * OVERSCAN;
    const last = Math.min(this.items.length, first + visible);
    this.resizePool(last - first);
    this.rows.forEach((row, i) => this.drawRow(row, first + i, height));
  }

  resizePool(count) {
    while (this.rows.length < count) {
      const row = this.makeRow();
      row.classList.add('vlist-row');
      row.setAttribute('role', this.onSelect ? 'option' : 'listitem');
      this.rows.push(row);
      this.space.append(row);
    }
    while (this.rows.length > count) this.rows.pop().remove();
  }

  drawRow(row, index, height) {
    const item = this.items[index];
    const selected = this.keyOf(item) === this.selectedKey;
    row.id = this.root.id + '-' + index;
    row.dataset.index = index;
    row.style.transform = 'translateY(' + index * height + 'px)';
    row.setAttribute('aria-setsize', this.items.length);
    row.setAttribute('aria-posinset', index + 1);
    if (this.onSelect) row.setAttribute('aria-selected', selected);
    if (selected && this.onSelect) this.root.setAttribute('aria-activedescendant', row.id);
    this.updateRow(row, item);
  }

  onClick(event) {
    const row = event.target.closest('.vlist-row');
    if (row) this.onSelect(this.items[Number(row.dataset.index)]);
  }

  onKey(event) {
    const page = Math.max(1, Math.floor(this.root.clientHeight / this.rowHeight) - 1);
    const steps =
        {ArrowDown: 1, ArrowUp: -1, PageDown: page, PageUp: -page, Home: -Infinity, End: Infinity};
    const step = steps[event.key];
    if (step === undefined || this.items.length === 0) return;
    event.preventDefault();
    const at = this.items.findIndex((item) => this.keyOf(item) === this.selectedKey);
    const to = Math.max(0, Math.min(this.items.length - 1, at + step));
    this.scrollTo(to);
    this.onSelect(this.items[to]);
  }

  scrollTo(index) {
    const height = this.rowHeight;
    const top = index * height;
    if (top < this.root.scrollTop) this.root.scrollTop = top;
    const bottom = top + height - this.root.clientHeight;
    if (bottom > this.root.scrollTop) this.root.scrollTop = bottom;
  }
}
