// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The numbers behind a chart, in a collapsed table below it.

import {el} from '../dom';

// Maximum number of rows; more would slow the page down and are not useful.
const ROWS_MAX = 2000;

// The first `textColumns` columns contain text, the others numbers. Null if there are no rows.
export function numbersTable(
    caption: string, headings: string[], rows: string[][], textColumns = 1): HTMLElement|null {
  if (!rows.length) return null;
  const kind = (i: number) => i < textColumns ? null : 'number';
  const head = el(
      'tr', {}, ...headings.map((heading, i) => el('th', {scope: 'col', class: kind(i)}, heading)));
  const body = rows.slice(0, ROWS_MAX).map((row) => el('tr', {}, ...row.map((text, i) => {
                                             return i === 0 ? el('th', {scope: 'row'}, text) :
                                                              el('td', {class: kind(i)}, text);
                                           })));
  const table =
      el('table', {}, el('caption', {}, caption), el('thead', {}, head), el('tbody', {}, ...body));
  const box =
      el('div', {class: 'table-box', tabindex: '0', role: 'region', 'aria-label': caption}, table);
  if (rows.length > ROWS_MAX)
    box.append(el('p', {}, 'The other ' + (rows.length - ROWS_MAX) + ' rows are in the JSON.'));
  return el('details', {class: 'numbers'}, el('summary', {}, 'Numbers: ' + caption), box);
}
