// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The picture viewer's controls: layer, exposure, zoom, the keys for them, and the legend of false
// colours. Keys work while the focus is in the viewer, so that no key surprises elsewhere.

import type {Layer, LayerRange} from './api';
import {falseColorPath} from './api';
import {byId, setText} from './dom';
import {STOPS_MAX, STOPS_STEP} from './exposure';
import * as format from './format';
import type {PictureViewport} from './picture_viewport';

// By which the keys and buttons zoom, and share of the box by which arrows pan.
const ZOOM_STEP = 2;
const PAN_SHARE = 0.125;

const LEGENDS: Record<Layer, string> = {
  picture: '',
  light: '',
  error: 'Standard error of a pixel, relative to its value; logarithmic. Gray: not known yet.',
  samples: 'Samples of a pixel. Gray: none yet.',
  time: 'Processor time of a pixel, the mean over its tile; logarithmic. Gray: not known.',
};

export class ViewerControls {
  private readonly layerSelect = byId<HTMLSelectElement>('layer');
  private readonly exposure = byId<HTMLInputElement>('exposure');

  // `onChange` is told of another layer or exposure.
  constructor(private readonly viewport: PictureViewport, private readonly onChange: () => void) {
    this.exposure.min = String(-STOPS_MAX);
    this.exposure.max = String(STOPS_MAX);
    this.exposure.step = String(STOPS_STEP);
    this.exposure.value = '0';
    this.layerSelect.addEventListener('change', () => this.changed());
    this.exposure.addEventListener('input', () => this.changed());
    byId('exposure-reset').addEventListener('click', () => this.setStops(0));
    byId('zoom-in').addEventListener('click', () => this.zoomBy(ZOOM_STEP));
    byId('zoom-out').addEventListener('click', () => this.zoomBy(1 / ZOOM_STEP));
    byId('zoom-fit').addEventListener('click', () => viewport.fit());
    byId('picture-zoom').addEventListener('click', () => viewport.zoomTo(1));
    byId('viewer').addEventListener('keydown', (event) => this.onKey(event));
    this.drawExposure();
  }

  get stops(): number {
    return Number(this.exposure.value);
  }

  // What to fetch: another exposure needs the light itself, not the picture made of it.
  get layer(): Layer {
    const chosen = this.layerSelect.value as Layer;
    return chosen === 'picture' && this.stops !== 0 ? 'light' : chosen;
  }

  // Follows the viewport.
  drawZoom() {
    const {scale, isFitted} = this.viewport;
    setText(byId('zoom-level'), format.zoom(scale));
    byId('zoom-fit').setAttribute('aria-pressed', String(isFitted));
    byId('picture-zoom').setAttribute('aria-pressed', String(scale === 1));
  }

  // What the colours of the shown layer stand for.
  drawLegend(layer: Layer, range: LayerRange|null) {
    byId('legend').hidden = range === null;
    if (!range) return;
    const colors = byId<HTMLImageElement>('legend-colors');
    if (!colors.src) colors.src = falseColorPath;
    const words = (value: number) => valueWords(layer, range, value);
    const middle =
        layer !== 'samples' ? Math.sqrt(range.low * range.high) : (range.low + range.high) / 2;
    const single = range.low === range.high;
    setText(byId('legend-low'), single ? '' : words(range.low));
    setText(byId('legend-middle'), single ? '' : words(middle));
    setText(byId('legend-high'), words(range.high));
    setText(byId('legend-words'), LEGENDS[layer]);
  }

  private changed() {
    this.drawExposure();
    this.onChange();
  }

  private drawExposure() {
    const usable = this.layerSelect.value === 'picture';
    setText(byId('exposure-value'), format.signed(this.stops));
    this.exposure.setAttribute('aria-valuetext', format.signed(this.stops) + ' stops');
    this.exposure.disabled = !usable;
    byId<HTMLButtonElement>('exposure-reset').disabled = !usable || this.stops === 0;
  }

  private setStops(stops: number) {
    if (this.exposure.disabled) return;
    this.exposure.value = String(stops);
    this.changed();
  }

  private zoomBy(factor: number) {
    this.viewport.zoomTo(this.viewport.scale * factor);
  }

  private onKey(event: KeyboardEvent) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const act = this.actionOf(event.key) ??
        ((event.target as Element).classList.contains('picture-box') ? this.panOf(event.key) :
                                                                       undefined);
    if (!act) return;
    event.preventDefault();
    act();
  }

  private actionOf(key: string): (() => void)|undefined {
    const actions: Record<string, () => void> = {
      '+': () => this.zoomBy(ZOOM_STEP),
      '=': () => this.zoomBy(ZOOM_STEP),
      '-': () => this.zoomBy(1 / ZOOM_STEP),
      '0': () => this.viewport.fit(),
      '1': () => this.viewport.zoomTo(1),
      '[': () => this.setStops(this.stops - STOPS_STEP),
      ']': () => this.setStops(this.stops + STOPS_STEP),
    };
    return actions[key];
  }

  // An arrow moves what is seen that way, so the picture moves the other way.
  private panOf(key: string): (() => void)|undefined {
    const steps: Record<string, [number, number]> = {
      ArrowLeft: [PAN_SHARE, 0],
      ArrowRight: [-PAN_SHARE, 0],
      ArrowUp: [0, PAN_SHARE],
      ArrowDown: [0, -PAN_SHARE],
    };
    const step = steps[key];
    // A fitted picture leaves the arrows to the page.
    if (!step || this.viewport.isFitted) return undefined;
    return () => this.viewport.panByShare(...step);
  }
}

function valueWords(layer: Layer, range: LayerRange, value: number): string {
  if (!(range.high > 0)) return '–';
  if (layer === 'error') return format.share(value);
  return layer === 'time' ? format.shortTime(value) : format.exact(value);
}

// "0.1 % to 20 %"; nothing for layers without false colours.
export function rangeWords(layer: Layer, range: LayerRange|null): string {
  if (!range) return '';
  return valueWords(layer, range, range.low) + ' to ' + valueWords(layer, range, range.high);
}
