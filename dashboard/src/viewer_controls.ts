// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The viewer's controls: layer, exposure, zoom, their keys, and the legend of false colors. Keys
// work only while the viewer has the focus, so that they have no effect elsewhere.

import type {Layer, LayerRange} from './api';
import {falseColorPath} from './api';
import {LAYER_PREFIX} from './layer_choice';
import {byId, setText} from './dom';
import {STOPS_MAX, STOPS_STEP} from './exposure';
import * as format from './format';
import type {ImageViewport} from './image_viewport';

// Zoom factor of keys and buttons, and the fraction of the box by which arrow keys pan.
const ZOOM_STEP = 2;
const PAN_SHARE = 0.125;

const ZOOM_BUTTONS = ['zoom-in', 'zoom-out', 'zoom-fit', 'image-zoom'];

const LEGENDS: Record<Layer, string> = {
  image: '',
  light: '',
  error: 'Standard error of a pixel, relative to its value; logarithmic. Gray: not known yet.',
  samples: 'Samples of a pixel. Gray: none yet.',
  difference: 'Difference from the compared image, root mean square of red, green and blue; ' +
      'logarithmic. Gray: no number.',
  relative: 'The same, relative to the compared image (dark pixels: to a tenth of its mean); ' +
      'logarithmic. Gray: no number.',
  time: 'Processor time of a pixel, the mean over its tile; logarithmic. Gray: not known.',
};

export class ViewerControls {
  private readonly layerSelect = byId<HTMLSelectElement>('layer');
  private readonly exposure = byId<HTMLInputElement>('exposure');

  // isColor: whether a layer of the frame can be exposed. `onChange` is called when the layer or
  // the exposure changes.
  constructor(
      private readonly viewport: ImageViewport, private readonly isColor: (name: string) => boolean,
      private readonly onChange: () => void) {
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
    byId('image-zoom').addEventListener('click', () => viewport.zoomTo(1));
    byId('viewer').addEventListener('keydown', (event) => this.onKey(event));
    this.drawExposure();
  }

  get stops(): number {
    return Number(this.exposure.value);
  }

  // The layer to fetch: another exposure needs the linear light instead of the finished image.
  get layer(): Layer {
    if (this.canExpose) return this.stops !== 0 ? 'light' : 'image';
    return this.of ? 'image' : this.layerSelect.value as Layer;
  }

  // The chosen layer beside the color; '' for none.
  get of(): string {
    const {value} = this.layerSelect;
    return value.startsWith(LAYER_PREFIX) ? value.slice(LAYER_PREFIX.length) : '';
  }

  // The choice of layers has changed by itself.
  redraw() {
    this.drawExposure();
  }

  private get canExpose(): boolean {
    return this.layerSelect.value === 'image' || (this.of !== '' && this.isColor(this.of));
  }

  // Updates the zoom controls from the viewport.
  drawZoom() {
    const {scale, isFitted, hasImage} = this.viewport;
    setText(byId('zoom-level'), hasImage ? format.zoom(scale) : '–');
    for (const id of ZOOM_BUTTONS) byId<HTMLButtonElement>(id).disabled = !hasImage;
    byId('zoom-fit').setAttribute('aria-pressed', String(isFitted));
    byId('image-zoom').setAttribute('aria-pressed', String(scale === 1));
  }

  // Draws the color scale of the shown layer.
  drawLegend(layer: Layer, range: LayerRange|null) {
    byId('legend').hidden = range === null;
    if (!range) return;
    const colors = byId<HTMLImageElement>('legend-colors');
    if (!colors.src) colors.src = falseColorPath;
    const words = (value: number) => valueWords(layer, range, value);
    const isLinear = layer === 'samples' || layer === 'image';
    const middle = isLinear ? (range.low + range.high) / 2 : Math.sqrt(range.low * range.high);
    const single = range.low === range.high;
    setText(byId('legend-low'), single ? '' : words(range.low));
    setText(byId('legend-middle'), single ? '' : words(middle));
    setText(byId('legend-high'), words(range.high));
    const ofErrors = this.of + ': expected error of a pixel, relative to its value; logarithmic.';
    const legend = layer === 'error' && this.of ? ofErrors : LEGENDS[layer];
    setText(byId('legend-words'), legend || this.of + ', linear. Gray: no number.');
  }

  private changed() {
    this.drawExposure();
    this.onChange();
  }

  private drawExposure() {
    const usable = this.canExpose;
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
    const isReadout = event.shiftKey && event.key.startsWith('Arrow');
    if (event.ctrlKey || event.metaKey || event.altKey || isReadout) return;
    const act = this.actionOf(event.key) ??
        ((event.target as Element).classList.contains('image-box') ? this.panOf(event.key) :
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

  // An arrow key moves the view in its direction, so the image moves the opposite way.
  private panOf(key: string): (() => void)|undefined {
    const steps: Record<string, [number, number]> = {
      ArrowLeft: [PAN_SHARE, 0],
      ArrowRight: [-PAN_SHARE, 0],
      ArrowUp: [0, PAN_SHARE],
      ArrowDown: [0, -PAN_SHARE],
    };
    const step = steps[key];
    // A fitted image leaves the arrow keys to the page.
    if (!step || this.viewport.isFitted) return undefined;
    return () => this.viewport.panByShare(...step);
  }
}

function valueWords(layer: Layer, range: LayerRange, value: number): string {
  if (layer === 'image') return String(Number(value.toPrecision(3)));
  if (!(range.high > 0)) return layer === 'difference' || layer === 'relative' ? '0' : '–';
  if (layer === 'difference') return String(Number(value.toPrecision(2)));
  if (layer === 'error' || layer === 'relative') return format.share(value);
  return layer === 'time' ? format.shortTime(value) : format.exact(value);
}

// "0.1 % to 20 %"; empty for layers without false colors.
export function rangeWords(layer: Layer, range: LayerRange|null): string {
  if (!range) return '';
  return valueWords(layer, range, range.low) + ' to ' + valueWords(layer, range, range.high);
}
