// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The farm's counters. Counters of failures come first and are highlighted if they are not 0.

import type {Counter} from './api';
import {byId, child, el, setText} from './dom';
import * as format from './format';
import type {Store} from './store';

const FAILURE = /fail|mismatch|expired|lost|nonfinite|quarantin|poison|invalid|revoked|damag/;

export class CountersView {
  private cells = new Map<string, HTMLElement>();

  constructor(private readonly store: Store) {
    store.listen('counters', this.draw);
  }

  private readonly draw = () => {
    const list = byId('counters');
    const counters = [...this.store.counters];
    counters.sort((a, b) => Number(FAILURE.test(b.name)) - Number(FAILURE.test(a.name)));
    byId('counters-empty').hidden = counters.length > 0;
    drawAlarms(counters.filter(isAlarming).length);
    const keys = counters.map(keyOf);
    if (keys.join() !== [...this.cells.keys()].join()) {
      this.cells = new Map(counters.map((counter) => [keyOf(counter), makeCell(counter)]));
      list.replaceChildren(...this.cells.values());
    }
    for (const counter of counters) {
      const cell = this.cells.get(keyOf(counter));
      if (cell) updateCell(cell, counter);
    }
  };
}

const isAlarming = (counter: Counter) => FAILURE.test(counter.name) && counter.value > 0;

// The counters are in a tab that is hidden at first: the head of the panel tells of failures.
function drawAlarms(count: number) {
  const words = byId('counter-alarms');
  words.hidden = count === 0;
  setText(words, count === 1 ? '1 alert' : count + ' alerts');
}

const keyOf = (counter: Counter) => counter.name + '=' + counter.label_value;

// "sheaf_results_accepted_total" -> "results accepted".
function labelOf(counter: Counter): string {
  const words = counter.name.replace(/^sheaf_/, '').replace(/_total$/, '').replaceAll('_', ' ');
  return counter.label_value ? words + ', ' + counter.label_value : words;
}

function makeCell(counter: Counter): HTMLElement {
  return el(
      'div', {class: 'counter', title: counter.help}, el('dt', {}, labelOf(counter)), el('dd', {}));
}

function updateCell(cell: HTMLElement, counter: Counter) {
  const whole = Number.isInteger(counter.value) && counter.value < 1e7;
  setText(child(cell, 1), whole ? format.exact(counter.value) : format.count(counter.value));
  cell.dataset.alarm = isAlarming(counter) ? 'yes' : 'no';
}
