// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A command of the terminal in a field, with a button that copies it.

import {el} from './dom';

// How long the button shows "Copied".
const COPIED_MS = 2000;

export function commandField(command: string, label: string): HTMLElement {
  const field = el('input', {readonly: '', 'aria-label': label}) as HTMLInputElement;
  field.value = command;
  return el(
      'div', {class: 'command'}, field, el('button', {class: 'button', type: 'button'}, 'Copy'));
}

// Copies the command of the button that was pressed; does nothing for other buttons.
export async function copyCommand(button: HTMLButtonElement) {
  const field = button.parentElement?.querySelector('input');
  if (!field) return;
  const copied = await copy(field);
  button.textContent = copied ? 'Copied' : 'Press Ctrl+C';
  setTimeout(() => {
    button.textContent = 'Copy';
  }, COPIED_MS);
}

// Browsers provide the clipboard to secure origins only; elsewhere the text is at least selected.
async function copy(field: HTMLInputElement): Promise<boolean> {
  field.select();
  try {
    await navigator.clipboard.writeText(field.value);
    return true;
  } catch {
    return document.execCommand('copy');
  }
}
