// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Finds and builds elements. Text always becomes text nodes, so text from the farm is never parsed
// as HTML.

type Attributes = Record<string, string|null>;

// el("p", {class: "note", title: "..."}, "text", otherElement). A null value omits the attribute.
export function el(
    tag: string, attributes: Attributes = {}, ...children: (Node|string)[]): HTMLElement {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value !== null) element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

// The element with this id in index.html.
export function byId<Type extends HTMLElement = HTMLElement>(id: string): Type {
  const element = document.getElementById(id);
  if (!element) throw new Error('index.html has no element "' + id + '"');
  return element as Type;
}

// A child by its index; rows are made with a fixed number of children.
export function child(element: Element, index: number): HTMLElement {
  const found = element.children[index];
  if (!found) throw new Error('no child ' + index + ' of ' + element.className);
  return found as HTMLElement;
}

// Sets the text only if it differs, which avoids layout when nothing has changed.
export function setText(element: Element, text: string) {
  if (element.textContent !== text) element.textContent = text;
}

// A colored word for a state.
export function badge(state: string): HTMLElement {
  return el('span', {class: 'badge', 'data-state': state}, state);
}

export function setBadge(element: HTMLElement, state: string) {
  if (element.dataset.state === state) return;
  element.dataset.state = state;
  element.textContent = state;
}

// A thin bar that screen readers announce as a percentage.
export function progressBar(label: string): HTMLElement {
  return el(
      'div', {
        class: 'bar',
        role: 'progressbar',
        'aria-label': label,
        'aria-valuemin': '0',
        'aria-valuemax': '100'
      },
      el('div', {class: 'bar-fill'}));
}

export function setProgress(bar: HTMLElement, share: number, state: string) {
  const percent = Math.max(0, Math.min(100, share * 100));
  child(bar, 0).style.width = percent.toFixed(2) + '%';
  bar.setAttribute('aria-valuenow', percent.toFixed(0));
  bar.dataset.state = state;
}
