// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The viewer: the image of the shown frame and, for comparison, another one beside it, over a part
// of it, or as their difference. Both use the same layer and exposure and show the same region.

import type {Frame, Job, Layer, LayerRange} from './api';
import {CompareChoice} from './compare_choice';
import {CompareModeChoice} from './compare_mode';
import {byId, setText} from './dom';
import {EyesChoice, isStereo} from './eyes';
import {FullScreen} from './full_screen';
import {HistogramView} from './histogram';
import {ImagePane} from './image_pane';
import type {Wanted} from './image_pane';
import {linkViewports} from './image_viewport';
import {LAYER_PREFIX, LayerChoice} from './layer_choice';
import type {Histogram} from './light_bins';
import {PixelReadout} from './pixel_readout';
import {RoundSlider} from './round_slider';
import type {Store} from './store';
import {ScaleLegend, rangeWords} from './scale_legend';
import type {Scale} from './scale_legend';
import {ViewerControls} from './viewer_controls';

export class ImageView {
  private readonly pane: ImagePane;
  private readonly beside: ImagePane;
  private readonly controls: ViewerControls;
  private readonly rounds = new RoundSlider(() => this.pane.hurry());
  private readonly choice: CompareChoice;
  private readonly layers: LayerChoice;
  private readonly mode: CompareModeChoice;
  private readonly legend = new ScaleLegend(() => this.hurry());
  private readonly histogram = new HistogramView();
  private readonly fullScreen = new FullScreen();
  private job: string|null = null;
  // The compared frame, and the job that it was chosen for.
  private comparedFrame = '';
  private comparedJob: string|null = null;
  private eyes: EyesChoice|undefined;
  private rangeWords = '';
  private besideWords = '';

  constructor(private readonly store: Store) {
    this.pane = new ImagePane(store, {
      name: 'image',
      wanted: () => this.wantedOfShown(),
      eyes: () => this.eyes?.mode ?? 'both',
      onView: () => this.controls.drawZoom(),
      onRange: (layer, range) => this.onRange(layer, range),
      onHistogram: (histogram) => this.onHistogram(histogram),
    });
    this.beside = new ImagePane(store, {
      name: 'beside',
      wanted: () => this.wanted(store.beside, 'No image yet.', null, this.besideValue),
      eyes: () => isStereo(store.beside) ? this.eyes?.mode ?? 'both' : 'both',
      onView: () => {},
      onRange: (layer, range) => {
        const {of} = this.controls.shownOf(this.besideValue);
        this.besideWords = rangeWords(this.scaleOf(layer, of), range);
        this.drawNames();
      },
      onHistogram: () => {},
    });
    this.layers = new LayerChoice(store, () => {
      this.controls.redraw();
      this.hurry();
    });
    this.controls = new ViewerControls({
      viewport: this.pane.viewport,
      isColor: (name) => this.layers.isColor(name),
      onChange: () => this.hurry(),
      actionOf: (key) => this.comparisonOf(key),
    });
    this.mode = new CompareModeChoice(store, () => {
      this.hurry();
      this.drawNames();
    });
    this.eyes = new EyesChoice(store, () => {
      this.pane.again();
      this.beside.again();
    });
    new PixelReadout(
        store, [this.pane.viewport, this.beside.viewport], (x) => this.eyes?.shareOf(x) ?? x);
    this.choice = new CompareChoice(store, () => {
      this.hurry();
      this.drawNames();
    });
    linkViewports(this.pane.viewport, this.beside.viewport);
    for (const topic of ['frames', 'selection'] as const) store.listen(topic, this.draw);
    store.listen('beside', this.drawBeside);
  }

  // The effect of a key on the viewer; undefined for other keys.
  actionOf(key: string): (() => void)|undefined {
    return this.controls.actionOf(key);
  }

  private comparisonOf(key: string): (() => void)|undefined {
    const actions: Record<string, () => void> = {
      'f': () => this.fullScreen.toggle(),
      'b': () => this.mode.flip(),
      's': () => this.mode.choose(this.mode.mode === 'split' ? 'beside' : 'split'),
      'd': () => this.compareDenoised(),
      'x': () => this.eyes?.flip(),
    };
    return actions[key];
  }

  // The denoised layer over the right half of the image.
  private compareDenoised() {
    if (!this.layers.has('denoised')) return;
    this.choice.toggleOwn(LAYER_PREFIX + 'denoised');
    this.mode.choose('split');
  }

  private hurry() {
    this.pane.hurry();
    this.beside.hurry();
  }

  private readonly draw = () => {
    const {frame, jobName} = this.store;
    // Until a frame's first image arrives, the previous frame of the same job stays visible.
    if (this.job !== jobName) this.pane.clear();
    this.job = jobName;
    this.choice.follow();
    this.dropComparison();
    this.rounds.show(frame);
    this.pane.draw();
    this.drawNames();
  };

  // A comparison that was chosen for another job stays if this job has it, too.
  private dropComparison() {
    const {beside, frame, jobName} = this.store;
    if (!beside || !frame || jobName === this.comparedJob || this.choice.isOwn) return;
    if (beside.name === frame.name || !haveOneSize(beside, frame)) this.store.setBeside(undefined);
  }

  private readonly drawBeside = () => {
    // Newer images of the compared frame do not count as a new choice.
    const compared = this.store.beside?.name ?? '';
    if (compared !== this.comparedFrame) this.comparedJob = this.store.jobName;
    this.comparedFrame = compared;
    this.mode.draw();
    // Also where nothing is compared any longer: the difference is still shown.
    if (this.mode.isDifference)
      this.pane.hurry();
    else
      this.pane.draw();
    this.choice.draw();
    this.beside.draw();
    this.drawNames();
  };

  // The shown frame, or its difference from the compared one.
  private wantedOfShown(): Wanted {
    const {store} = this;
    const note = noteOf(store.job, store.frame);
    const other = store.beside;
    if (!this.mode?.isDifference || !other || other.preview_version === 0)
      return this.wanted(store.frame, note, this.rounds.round, this.controls.value);
    const why = this.whyNoDifference(store.frame, other);
    const layer: Layer = this.mode.mode === 'relative' ? 'relative' : 'difference';
    return {
      frame: why ? undefined : store.frame,
      view: {
        layer: why ? 'image' : layer,
        of: this.controls.shownOf(this.controls.value).of,
        other: why ? null : other,
        otherOf: this.controls.shownOf(this.besideValue).of,
        range: this.legend.chosenRange(layer, ''),
      },
      development: {stops: 0, falseColor: null, count: false},
      histogram: this.controls.hasHistogram,
      round: null,
      note: why || note,
    };
  }

  private whyNoDifference(frame: Frame|undefined, other: Frame): string {
    if (!frame || !haveOneSize(frame, other))
      return 'The two images differ in size, and so have no difference.';
    const {controls} = this;
    return controls.isColor(controls.value) && controls.isColor(this.besideValue) ?
        '' :
        'Only colors have a difference. Choose the image or a color as the layer of both.';
  }

  // The chosen layer of the compared frame.
  private get besideValue(): string {
    return this.choice?.layerValue || this.controls.value;
  }

  // value: the choice of its layer.
  private wanted(frame: Frame|undefined, note: string, chosen: number|null, value: string): Wanted {
    const {controls} = this;
    const {layer, of} = controls.shownOf(value);
    const scale = this.scaleOf(layer, of);
    const isFalse = controls.isFalse && layer === 'light';
    const range = this.legend.chosenRange(scale, of);
    const isScaled = layer !== 'light' && (layer !== 'image' || this.isScalar(of));
    const common = {
      frame,
      view: {layer, of, other: null, otherOf: '', range: isScaled ? range : null},
      development: {
        stops: controls.stops,
        falseColor: isFalse ? range ?? 'auto' as const: null,
        count: controls.needsCounts,
      },
      histogram: controls.hasHistogram,
      note,
    };
    // Other layers, and other ranges, are kept for the present image alone.
    if (of || common.view.range) return {...common, round: null};
    if (layer !== 'time') return {...common, round: chosen};
    // Times are recorded over all rounds together.
    return {...common, round: null, note: 'No times are kept for this frame.'};
  }

  private isScalar(of: string): boolean {
    return of !== '' && ['scalar', 'error'].includes(this.layers.kindOf(of));
  }

  private onRange(layer: Layer, range: LayerRange|null) {
    const isDifference = layer === 'difference' || layer === 'relative';
    const of = isDifference ? '' : this.controls.shownOf(this.controls.value).of;
    const scale = this.scaleOf(layer, of);
    this.rangeWords = rangeWords(scale, range);
    this.legend.draw(scale, of, this.layers.kindOf(of), range);
    this.drawNames();
  }

  private onHistogram(histogram: Histogram|null) {
    this.histogram.show(histogram, this.controls.stops);
    if (histogram?.isLight) this.controls.automaticStopsAre(histogram.automaticStops);
  }

  // The scale of a layer's colors.
  private scaleOf(layer: Layer, of: string): Scale {
    if (layer === 'light') return 'light';
    if (layer !== 'image') return layer;
    return this.layers.isError(of) ? 'error' : 'value';
  }

  // Names the two images and their color scales, whose ranges may differ.
  private drawNames() {
    const {frame, beside} = this.store;
    const name = (of: Frame|undefined, range: string) =>
        of ? this.titleOf(of) + (range ? ' · ' + range : '') : '';
    byId('image-name').hidden = !beside;
    const layer = this.choice.layerValue;
    const own = this.choice.isOwn && frame;
    setText(
        byId('image-name'),
        own && layer ? 'A: ' + layerWords(this.controls.value) : name(frame, this.rangeWords));
    setText(
        byId('beside-name'),
        (own ? 'B: ' + layerWords(layer || this.controls.value) + rangeOf(this.besideWords) :
               name(beside, this.besideWords)));
  }

  private titleOf(frame: Frame): string {
    const name = frame.name.replace(/\/frames\/.*/, '');
    return (this.store.jobs.get(name)?.title || name) + ' (' + name + '), frame ' +
        frame.frame_number;
  }
}

// The words of the select for a layer.
function layerWords(value: string): string {
  const {options} = byId<HTMLSelectElement>('layer');
  return [...options].find((option) => option.value === value)?.text ?? value;
}

const rangeOf = (words: string) => words ? ' · ' + words : '';

function haveOneSize({window: a}: Frame, {window: b}: Frame): boolean {
  return a.x1_px - a.x0_px === b.x1_px - b.x0_px && a.y1_px - a.y0_px === b.y1_px - b.y0_px;
}

function noteOf(job: Job|undefined, frame: Frame|undefined): string {
  if (!job) return 'Select a job to see its image.';
  if (job.waiting_reason) return 'Waiting: ' + job.waiting_reason.replace(/^waiting /, '');
  if (job.state === 'failed') return 'The job failed before there was an image.';
  if (job.state === 'cancelled') return 'The job was cancelled before there was an image.';
  if (job.state === 'paused') return 'Paused before the first samples.';
  if (!frame) return '';
  return frame.preview_version > 0 ? 'The image is being loaded.' : 'No samples yet.';
}
