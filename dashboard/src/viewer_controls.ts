// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The viewer's controls: layer, exposure, false color, histogram, zoom, and their keys. Keys work
// while the viewer has the focus or fills the window; keys.ts passes on those of the whole page.

import type {Layer} from './api';
import {LAYER_PREFIX} from './layer_choice';
import {byId, setText} from './dom';
import {STOPS_MAX, STOPS_STEP} from './exposure';
import * as format from './format';
import type {ImageViewport} from './image_viewport';

// Zoom factor of keys and buttons, and the fraction of the box by which arrow keys pan.
const ZOOM_STEP = 2;
const PAN_SHARE = 0.125;
// The slider is finer than its keys, so that automatic exposures are near.
const SLIDER_STEP = 0.1;

const ZOOM_BUTTONS = ['zoom-in', 'zoom-out', 'zoom-fit', 'image-zoom'];

// A layer to fetch: its name, and that of a layer beside the color or ''.
export interface ShownLayer {
  layer: Layer;
  of: string;
}

export interface ControlsOptions {
  viewport: ImageViewport;
  // Whether a layer of the frame can be exposed.
  isColor: (name: string) => boolean;
  // The layer, the exposure or what is shown of them has changed.
  onChange: () => void;
  // Keys of the comparison; undefined for others.
  actionOf: (key: string) => (() => void) | undefined;
}

export class ViewerControls {
  private readonly layerSelect = byId<HTMLSelectElement>('layer');
  private readonly exposure = byId<HTMLInputElement>('exposure');
  private wantsAutomatic = false;

  constructor(private readonly options: ControlsOptions) {
    const {viewport} = options;
    this.exposure.min = String(-STOPS_MAX);
    this.exposure.max = String(STOPS_MAX);
    this.exposure.step = String(SLIDER_STEP);
    this.exposure.value = '0';
    this.layerSelect.addEventListener('change', () => this.changed());
    this.exposure.addEventListener('input', () => this.changed());
    byId('exposure-reset').addEventListener('click', () => this.setStops(0));
    byId('exposure-auto').addEventListener('click', () => this.exposeAutomatically());
    byId('zoom-in').addEventListener('click', () => this.zoomBy(ZOOM_STEP));
    byId('zoom-out').addEventListener('click', () => this.zoomBy(1 / ZOOM_STEP));
    byId('zoom-fit').addEventListener('click', () => viewport.fit());
    byId('image-zoom').addEventListener('click', () => viewport.zoomTo(1));
    for (const id of ['false-color', 'histogram-show', 'viewer-more'])
      byId(id).addEventListener('click', () => this.toggle(id));
    byId('viewer').addEventListener('keydown', (event) => this.onKey(event));
    this.drawExposure();
  }

  get stops(): number {
    return Number(this.exposure.value);
  }

  // Whether colors are shown in false color.
  get isFalse(): boolean {
    return isPressed('false-color');
  }

  get hasHistogram(): boolean {
    return isPressed('histogram-show');
  }

  // Whether the values of the light are counted.
  get needsCounts(): boolean {
    return this.hasHistogram || this.wantsAutomatic;
  }

  // The layer to fetch for a choice of the select. Another exposure needs the linear light instead
  // of the finished image, and so do false color and the histogram.
  shownOf(value: string): ShownLayer {
    const of = value.startsWith(LAYER_PREFIX) ? value.slice(LAYER_PREFIX.length) : '';
    const isColor = value === 'image' || (of !== '' && this.options.isColor(of));
    const needsLight = this.stops !== 0 || this.isFalse || this.needsCounts;
    if (isColor) return {layer: needsLight ? 'light' : 'image', of};
    return {layer: of ? 'image' : value as Layer, of};
  }

  get value(): string {
    return this.layerSelect.value;
  }

  // Whether the choice can be exposed.
  isColor(value: string): boolean {
    return value === 'image' ||
        (value.startsWith(LAYER_PREFIX) && this.options.isColor(value.slice(LAYER_PREFIX.length)));
  }

  // The choice of layers has changed by itself.
  redraw() {
    this.drawExposure();
  }

  // The stops of the automatic exposure of the shown light.
  automaticStopsAre(stops: number) {
    if (!this.wantsAutomatic) return;
    this.wantsAutomatic = false;
    this.setStops(stops);
  }

  // Updates the zoom controls from the viewport.
  drawZoom() {
    const {scale, isFitted, hasImage} = this.options.viewport;
    setText(byId('zoom-level'), hasImage ? format.zoom(scale) : '–');
    for (const id of ZOOM_BUTTONS) byId<HTMLButtonElement>(id).disabled = !hasImage;
    byId('zoom-fit').setAttribute('aria-pressed', String(isFitted));
    byId('image-zoom').setAttribute('aria-pressed', String(scale === 1));
  }

  private toggle(id: string) {
    const pressed = !isPressed(id);
    byId(id).setAttribute('aria-pressed', String(pressed));
    if (id === 'viewer-more') byId('viewer').dataset.more = pressed ? 'yes' : 'no';
    byId('histogram-box').hidden = !this.hasHistogram;
    this.changed();
  }

  private changed() {
    this.drawExposure();
    this.options.onChange();
  }

  private drawExposure() {
    const isColor = this.isColor(this.value);
    const usable = isColor && !this.isFalse;
    setText(byId('exposure-value'), format.signed(this.stops));
    this.exposure.setAttribute('aria-valuetext', format.signed(this.stops) + ' stops');
    this.exposure.disabled = !usable;
    byId<HTMLButtonElement>('exposure-auto').disabled = !usable;
    byId<HTMLButtonElement>('exposure-reset').disabled = !usable || this.stops === 0;
    // Other layers are in false color anyway, or are no quantities.
    byId<HTMLButtonElement>('false-color').disabled = !isColor;
  }

  private setStops(stops: number) {
    if (this.exposure.disabled) return;
    this.exposure.value = String(stops);
    this.changed();
  }

  // Once the light is fetched and its values are counted.
  private exposeAutomatically() {
    if (this.exposure.disabled) return;
    this.wantsAutomatic = true;
    this.options.onChange();
  }

  private zoomBy(factor: number) {
    const {viewport} = this.options;
    viewport.zoomTo(viewport.scale * factor);
  }

  private nextLayer(step: number) {
    const {options, selectedIndex} = this.layerSelect;
    this.layerSelect.selectedIndex = (selectedIndex + step + options.length) % options.length;
    this.changed();
  }

  private onKey(event: KeyboardEvent) {
    const isReadout = event.shiftKey && event.key.startsWith('Arrow');
    if (event.ctrlKey || event.metaKey || event.altKey || isReadout || isTyping(event)) return;
    const act = this.actionOf(event.key) ??
        ((event.target as Element).classList.contains('image-box') ? this.panOf(event.key) :
                                                                     undefined);
    if (!act) return;
    event.preventDefault();
    event.stopPropagation();
    act();
  }

  // Undefined for keys that have no effect on the viewer.
  actionOf(key: string): (() => void)|undefined {
    const {viewport} = this.options;
    const actions: Record<string, () => void> = {
      '+': () => this.zoomBy(ZOOM_STEP),
      '=': () => this.zoomBy(ZOOM_STEP),
      '-': () => this.zoomBy(1 / ZOOM_STEP),
      '0': () => viewport.fit(),
      '1': () => viewport.zoomTo(1),
      '[': () => this.setStops(this.stops - STOPS_STEP),
      ']': () => this.setStops(this.stops + STOPS_STEP),
      'e': () => this.exposeAutomatically(),
      'c': () => byId('false-color').click(),
      'h': () => this.toggle('histogram-show'),
      'l': () => this.nextLayer(1),
      'L': () => this.nextLayer(-1),
    };
    return actions[key] ?? this.options.actionOf(key);
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
    if (!step || this.options.viewport.isFitted) return undefined;
    return () => this.options.viewport.panByShare(...step);
  }
}

const isPressed = (id: string) => byId(id).getAttribute('aria-pressed') === 'true';

// Letters in a select choose its options, and digits in a field are numbers.
export function isTyping(event: KeyboardEvent): boolean {
  const target = event.target as HTMLElement;
  if (target.matches('input[type="range"], input[type="radio"]')) return false;
  return target.matches('input, textarea') ||
      (target.matches('select') && /^[a-z]$/i.test(event.key));
}
