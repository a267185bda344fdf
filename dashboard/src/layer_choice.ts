// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Offers the layers and AOVs of the shown frame beside its image, errors, samples and times.
// Fetched once for each frame that is shown.

import * as api from './api';
import type {ChannelLayer} from './api';
import {byId, el} from './dom';
import type {Store} from './store';

// Values of the select's options: "of:albedo".
export const LAYER_PREFIX = 'of:';
const ATTEMPT = 'loading the layers';

const KIND_WORDS: Record<string, string> = {
  color: '',
  direction: 'direction',
  vector: 'position',
  scalar: 'value',
  id: 'id',
  error: 'relative error',
};

export class LayerChoice {
  private readonly select = byId<HTMLSelectElement>('layer');
  private readonly group = byId<HTMLOptGroupElement>('layer-channels');
  private frameName = '';
  private layers: readonly ChannelLayer[] = [];

  // `onGone` is called when the chosen layer is none of the frame's.
  constructor(private readonly store: Store, private readonly onGone: () => void) {
    for (const topic of ['frames', 'selection'] as const) store.listen(topic, this.draw);
  }

  // Whether the chosen layer is a color, which can be exposed.
  isColor(name: string): boolean {
    return this.layers.find((layer) => layer.name === name)?.kind === 'color';
  }

  // Whether the layer holds errors of a color, which have the scale of the standard error.
  isError(name: string): boolean {
    return this.layers.find((layer) => layer.name === name)?.kind === 'error';
  }

  // "color", "direction" and so on; '' for the image and its own layers.
  kindOf(name: string): string {
    return this.layers.find((layer) => layer.name === name)?.kind ?? '';
  }

  // Whether the shown frame has it.
  has(name: string): boolean {
    return this.layers.some((layer) => layer.name === name);
  }

  private readonly draw = () => {
    const {frame} = this.store;
    if (!frame || frame.name === this.frameName) return;
    this.frameName = frame.name;
    void this.fetch(frame.name);
  };

  private async fetch(name: string) {
    try {
      const {layers} = await api.getLayers(name);
      this.store.note(ATTEMPT, null);
      if (name === this.frameName) this.show(layers);
    } catch (failure) {
      // A restarted coordinator may not have the job; it is asked again for the next frame.
      if (name === this.frameName) this.show([]);
      if (!(failure instanceof api.ApiError && failure.status === 404))
        this.store.note(ATTEMPT, failure);
    }
  }

  private show(layers: readonly ChannelLayer[]) {
    if (JSON.stringify(layers) === JSON.stringify(this.layers)) return;
    this.layers = layers;
    const {value} = this.select;
    this.group.hidden = layers.length === 0;
    this.group.replaceChildren(...layers.map(makeOption));
    const isThere = [...this.select.options].some((option) => option.value === value);
    this.select.value = isThere ? value : 'image';
    if (!isThere) this.onGone();
  }
}

function makeOption({name, kind}: ChannelLayer): HTMLElement {
  const words = KIND_WORDS[kind] ?? '';
  return el('option', {value: LAYER_PREFIX + name}, name + (words ? ' (' + words + ')' : ''));
}
