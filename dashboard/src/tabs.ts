// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tabs of a panel: one is shown, and is the only stop of the Tab key; arrow, Home and End keys
// choose another. Source: WAI-ARIA Authoring Practices, tabs with automatic activation.

import {byId} from './dom';

// list: the element with the role tablist.
export function startTabs(list: HTMLElement) {
  const tabs = [...list.querySelectorAll<HTMLElement>('[role="tab"]')];
  const select = (chosen: HTMLElement) => {
    for (const tab of tabs) {
      tab.setAttribute('aria-selected', String(tab === chosen));
      tab.tabIndex = tab === chosen ? 0 : -1;
      byId(tab.getAttribute('aria-controls') ?? '').hidden = tab !== chosen;
    }
  };
  list.addEventListener('click', (event) => {
    const tab = (event.target as Element).closest<HTMLElement>('[role="tab"]');
    if (tab) select(tab);
  });
  list.addEventListener('keydown', (event) => {
    const at = tabs.indexOf(event.target as HTMLElement);
    const to: Record<string, number> = {
      ArrowRight: (at + 1) % tabs.length,
      ArrowLeft: (at + tabs.length - 1) % tabs.length,
      Home: 0,
      End: tabs.length - 1,
    };
    const tab = tabs[to[event.key] ?? -1];
    if (at < 0 || !tab) return;
    event.preventDefault();
    select(tab);
    tab.focus();
  });
}
