// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Rows of bars or dots over one axis or several axes side by side. Positions are fractions of the
// width, so the browser fits them to any window without a script.

import {el} from '../dom';

import type {Maybe} from './numbers';
import {isKnown} from './numbers';
import type {Scale} from './scale';
import type {Series} from './svg';
import {svg} from './svg';

export interface Column {
  heading: string;
  scale: Scale;
  // The value at which bars begin; null draws dots instead.
  origin: number|null;
  // Values marked by a line in every row, such as 1 for a ratio.
  marks: number[];
}

export interface Cell {
  value: Maybe;
  error?: Maybe;
  // Only an upper bound of the value is known.
  isLimit?: boolean;
  // A second value, drawn small for comparison.
  other?: Maybe;
  // The numbers as text.
  words: string;
  isAlarming?: boolean;
}

export interface Row {
  name: string;
  note?: string;
  series: Series|null;
  // One per column.
  cells: Cell[];
}

const TRACK_HEIGHT_REM = 1.5;

const percent = (share: number) => (100 * share).toFixed(3) + '%';

// A figure with the id; data-count gives the number of its bars and dots. `empty` is the text shown
// if there are none.
export function barChart(
    id: string, label: string, columns: Column[], rows: Row[], empty: string): HTMLElement {
  const drawn = rows.reduce(
      (sum, row) => sum + row.cells.filter(({value}, i) => columns[i]?.scale.has(value)).length, 0);
  if (!drawn) return el('p', {id, class: 'empty', 'data-count': '0'}, empty);
  return el(
      'figure', {
        id,
        class: 'bars',
        role: 'img',
        'aria-label': label,
        'data-count': String(drawn),
        'data-columns': String(columns.length),
        style: '--columns: ' + columns.length,
      },
      headRow(columns), ...rows.map((row) => rowOf(row, columns)), axisRow(columns));
}

function headRow(columns: Column[]): HTMLElement {
  const heads = columns.map(({heading}) => el('span', {class: 'bars-head'}, heading));
  return el('div', {class: 'bars-row bars-heads'}, el('span'), ...heads);
}

function rowOf(row: Row, columns: Column[]): HTMLElement {
  const name = el('div', {class: 'bars-name'}, el('span', {}, row.name));
  if (row.note) name.append(el('small', {}, row.note));
  const cells = columns.map((column, i) => {
    const cell = row.cells[i] ?? {value: null, words: ''};
    const words = el('span', {class: 'bars-value'}, cell.words);
    if (cell.isAlarming) words.dataset.alarm = 'yes';
    return el(
        'div', {class: 'bars-cell', 'data-heading': column.heading},
        track(cell, column, row.series), words);
  });
  return el(
      'div', {class: 'bars-row', 'data-empty': row.cells.length ? null : 'yes'}, name, ...cells);
}

function axisRow(columns: Column[]): HTMLElement {
  const axes = columns.map(({scale}) => {
    const ticks = scale.ticks.filter(({words}) => words)
                      .map(
                          ({value, words}) =>
                              el('span', {style: 'left: ' + percent(scale.at(value))}, words));
    return el(
        'div', {class: 'bars-cell'}, el('div', {class: 'bars-axis'}, ...ticks),
        el('span', {class: 'bars-value'}));
  });
  return el('div', {class: 'bars-row bars-axes'}, el('span'), ...axes);
}

function track(cell: Cell, column: Column, series: Series|null): HTMLElement {
  const {scale, origin} = column;
  const image = svg('svg', {width: '100%', height: '100%'});
  for (const {value, words} of scale.ticks) {
    if (words) image.append(upright('grid', scale.at(value)));
  }
  for (const mark of column.marks) image.append(upright('mark', scale.at(mark)));
  const {value} = cell;
  if (scale.has(value)) {
    if (cell.isLimit)
      image.append(bar('limit', 0, scale.at(value)));
    else if (origin !== null)
      image.append(bar('bar', scale.at(origin), scale.at(value)));
    if (!cell.isLimit && isKnown(cell.error) && cell.error > 0)
      image.append(whisker(scale.at(value - cell.error), scale.at(value + cell.error)));
    if (!cell.isLimit && origin === null) image.append(dot('dot', scale.at(value), '0.35rem'));
  }
  if (scale.has(cell.other)) image.append(dot('other', scale.at(cell.other), '0.3rem'));
  const box = el('div', {class: 'bars-track'}, image);
  box.style.height = TRACK_HEIGHT_REM + 'rem';
  if (series) box.style.setProperty('--series', series.color);
  return box;
}

const upright = (name: string, at: number) =>
    svg('line', {class: name, x1: percent(at), x2: percent(at), y1: '0%', y2: '100%'});

// At least a hair wide, so that a value at the origin is visible.
function bar(name: string, from: number, to: number): SVGElement {
  const width = Math.max(0.003, Math.abs(to - from));
  const x = Math.min(from, to, 1 - width);
  return svg('rect', {class: name, x: percent(x), width: percent(width), y: '22%', height: '56%'});
}

function whisker(low: number, high: number): SVGElement {
  const [x1, x2] = [percent(low), percent(high)];
  return svg(
      'g', {class: 'whisker'}, svg('line', {x1, x2, y1: '50%', y2: '50%'}),
      svg('line', {x1, x2: x1, y1: '32%', y2: '68%'}),
      svg('line', {x1: x2, x2, y1: '32%', y2: '68%'}));
}

const dot = (name: string, at: number, r: string) =>
    svg('circle', {class: name, cx: percent(at), cy: '50%', r});
