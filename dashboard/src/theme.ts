// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Light or dark theme, or the system's. The browser stores the choice.

import {byId} from './dom';

const KEY = 'sheaf-theme';

export function startTheme() {
  const system = matchMedia('(prefers-color-scheme: dark)');
  const isDark = () =>
      (localStorage.getItem(KEY) || (system.matches ? 'dark' : 'light')) === 'dark';
  const apply = () => {
    document.documentElement.dataset.theme = isDark() ? 'dark' : 'light';
    byId('theme').setAttribute('aria-pressed', String(isDark()));
  };
  byId('theme').addEventListener('click', () => {
    localStorage.setItem(KEY, isDark() ? 'light' : 'dark');
    apply();
  });
  system.addEventListener('change', apply);
  apply();
}
