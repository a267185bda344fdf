// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Asks for confirmation of actions that cannot be undone. The harmless answer has the focus; Escape
// selects it.

import {byId, setText} from './dom';

export interface Question {
  title: string;
  text: string;
  no: string;
  yes: string;
}

// Returns whether the answer was yes. Returns false at once while another question is open.
export function confirm({title, text, no, yes}: Question): Promise<boolean> {
  const dialog = byId<HTMLDialogElement>('confirm');
  if (dialog.open) return Promise.resolve(false);
  setText(byId('confirm-title'), title);
  setText(byId('confirm-text'), text);
  setText(byId('confirm-no'), no);
  setText(byId('confirm-yes'), yes);
  dialog.returnValue = 'no';
  dialog.showModal();
  return new Promise((resolve) => {
    dialog.addEventListener('close', () => resolve(dialog.returnValue === 'yes'), {once: true});
  });
}
