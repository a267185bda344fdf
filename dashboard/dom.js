// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Builds elements. Text always becomes text nodes, so nothing the farm says is ever read as HTML.

// el("p", {class: "note", title: "..."}, "text", otherElement). A property that begins with "on" is
// an event listener; null and false leave a property out.
export function el(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (value === null || value === false) continue;
    if (name.startsWith('on'))
      element.addEventListener(name.slice(2), value);
    else
      element.setAttribute(name, value === true ? '' : value);
  }
  element.append(...children);
  return element;
}

export const byId = (id) => document.getElementById(id);

// Sets text only where it differs, which spares layout when nothing changed.
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

// A coloured word for a state.
export function badge(state) {
  return el('span', {class: 'badge', 'data-state': state}, state);
}

export function setBadge(element, state) {
  if (element.dataset.state === state) return;
  element.dataset.state = state;
  element.textContent = state;
}

// A thin bar that screen readers hear as a percentage.
export function progressBar(label) {
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

export function setProgress(bar, share, state) {
  const percent = Math.max(0, Math.min(100, share * 100));
  bar.firstElementChild.style.width = percent.toFixed(2) + '%';
  bar.setAttribute('aria-valuenow', percent.toFixed(0));
  bar.dataset.state = state;
}
