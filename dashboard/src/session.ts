// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The session of a coordinator with certificates: shows a button that ends it. Without certificates
// there is no session and no button.

import {getSession, signOut} from './api';
import {byId} from './dom';
import {Store} from './store';

export async function startSession(store: Store) {
  const button = byId<HTMLButtonElement>('sign-out');
  button.addEventListener('click', async () => {
    button.disabled = true;
    try {
      await signOut();
      location.assign('/login');
    } catch (failure) {
      button.disabled = false;
      store.note('signing out', failure);
    }
  });
  try {
    const session = await getSession();
    button.hidden = session.user === '';
    store.role = session.role;
    store.touch('workers');
    button.title = 'Signed in as ' + session.user + ', with the role ' + session.role;
  } catch (failure) {
    store.note('asking who is signed in', failure);
  }
}
