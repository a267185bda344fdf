// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The views of the page: an image with its job, and tables of jobs, workers and days that take the
// whole window. The address names the view: "#/workers".

import {byId} from './dom';
import type {FarmViewName, Store} from './store';

const NAMES: readonly FarmViewName[] = ['image', 'jobs', 'workers', 'history'];

export class FarmViews {
  constructor(private readonly store: Store, private readonly backToImage: () => void) {
    for (const name of NAMES) byId('view-' + name).addEventListener('click', () => this.open(name));
  }

  // By the address, so that the browser's own keys lead back.
  open(name: FarmViewName) {
    if (name === 'image')
      this.backToImage();
    else
      location.hash = '/' + name;
  }

  // Follows the address. Returns whether it names a view other than the image.
  readAddress(): boolean {
    const name = NAMES.find((one) => location.hash === '#/' + one) ?? 'image';
    this.store.setView(name);
    document.querySelector('main')?.setAttribute('data-view', name);
    for (const one of NAMES) {
      const button = byId('view-' + one);
      if (one === name)
        button.setAttribute('aria-current', 'page');
      else
        button.removeAttribute('aria-current');
    }
    return name !== 'image';
  }
}
