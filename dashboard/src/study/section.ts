// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// One section of the page: an explanation, a chart, and a table. Null means an empty part.

import {el} from '../dom';

export function section(
    name: string, heading: string, words: string[], ...parts: (HTMLElement|null)[]): HTMLElement {
  const id = name + '-heading';
  return el(
      'section', {class: 'panel', id: name, 'aria-labelledby': id}, el('h2', {id}, heading),
      ...words.map((text) => el('p', {class: 'words'}, text)),
      ...parts.filter((part) => part !== null));
}
