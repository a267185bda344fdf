// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The farm's counters; those that count failures come first and stand out when they are not 0.

import {byId, el, setText} from './dom.js';
import * as format from './format.js';

const FAILURE = /fail|mismatch|expired|lost|nonfinite|quarantin|poison|invalid|revoked|damag/;

export class CountersView {
  constructor(store) {
    this.store = store;
    this.cells = new Map();
    store.listen('counters', this.draw);
  }

  draw = () => {
    const list = byId('counters');
    const counters = [...this.store.counters];
    counters.sort((a, b) => FAILURE.test(b.name) - FAILURE.test(a.name));
    byId('counters-empty').hidden = counters.length > 0;
    const keys = counters.map(keyOf);
    if (keys.join() !== [...this.cells.keys()].join()) {
      this.cells = new Map(counters.map((counter) => [keyOf(counter), makeCell(counter)]));
      list.replaceChildren(...this.cells.values());
    }
    for (const counter of counters) updateCell(this.cells.get(keyOf(counter)), counter);
  };
}

const keyOf = (counter) => counter.name + '=' + counter.label_value;

// "sheaf_results_accepted_total" -> "results accepted".
function labelOf(counter) {
  const words = counter.name.replace(/^sheaf_/, '').replace(/_total$/, '').replaceAll('_', ' ');
  return counter.label_value ? words + ', ' + counter.label_value : words;
}

function makeCell(counter) {
  return el(
      'div', {class: 'counter', title: counter.help}, el('dt', {}, labelOf(counter)), el('dd', {}));
}

function updateCell(cell, counter) {
  const whole = Number.isInteger(counter.value) && counter.value < 1e7;
  setText(cell.lastElementChild, whole ? format.exact(counter.value) : format.count(counter.value));
  const alarming = FAILURE.test(counter.name) && counter.value > 0;
  cell.dataset.alarm = alarming ? 'yes' : 'no';
}
