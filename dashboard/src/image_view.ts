// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The viewer: the image of the shown frame and, for comparison, another one beside it, over a part
// of it, or as their difference. Both use the same layer and exposure and show the same region.

import type {Frame, Job, Layer, LayerRange} from './api';
import {CompareChoice} from './compare_choice';
import {CompareModeChoice} from './compare_mode';
import {byId, setText} from './dom';
import {ImagePane} from './image_pane';
import type {Wanted} from './image_pane';
import {linkViewports} from './image_viewport';
import {LayerChoice} from './layer_choice';
import {PixelReadout} from './pixel_readout';
import {RoundSlider} from './round_slider';
import type {Store} from './store';
import {ViewerControls, rangeWords} from './viewer_controls';

export class ImageView {
  private readonly pane: ImagePane;
  private readonly beside: ImagePane;
  private readonly controls: ViewerControls;
  private readonly rounds = new RoundSlider(() => this.pane.hurry());
  private readonly choice: CompareChoice;
  private readonly layers: LayerChoice;
  private readonly mode: CompareModeChoice;
  private job: string|null = null;
  // The compared frame, and the job that it was chosen for.
  private comparedFrame = '';
  private comparedJob: string|null = null;
  private rangeWords = '';
  private besideWords = '';

  constructor(private readonly store: Store) {
    this.pane = new ImagePane(store, {
      name: 'image',
      wanted: () => this.wantedOfShown(),
      onView: () => this.controls.drawZoom(),
      onRange: (layer, range) => this.onRange(layer, range),
    });
    this.beside = new ImagePane(store, {
      name: 'beside',
      wanted: () => this.wanted(store.beside, 'No image yet.', null),
      onView: () => {},
      onRange: (layer, range) => {
        this.besideWords = rangeWords(this.scaleOf(layer), range);
        this.drawNames();
      },
    });
    const hurry = () => {
      this.pane.hurry();
      this.beside.hurry();
    };
    this.layers = new LayerChoice(store, () => {
      this.controls.redraw();
      hurry();
    });
    this.controls =
        new ViewerControls(this.pane.viewport, (name) => this.layers.isColor(name), hurry);
    this.mode = new CompareModeChoice(store, () => {
      hurry();
      this.drawNames();
    });
    new PixelReadout(store, [this.pane.viewport, this.beside.viewport]);
    this.choice = new CompareChoice(store);
    linkViewports(this.pane.viewport, this.beside.viewport);
    for (const topic of ['frames', 'selection'] as const) store.listen(topic, this.draw);
    store.listen('beside', this.drawBeside);
  }

  private readonly draw = () => {
    const {frame, jobName} = this.store;
    // Until a frame's first image arrives, the previous frame of the same job stays visible.
    if (this.job !== jobName) this.pane.clear();
    this.job = jobName;
    this.dropComparison();
    this.rounds.show(frame);
    this.pane.draw();
    this.drawNames();
  };

  // A comparison that was chosen for another job stays if this job has it, too.
  private dropComparison() {
    const {beside, frame, jobName} = this.store;
    if (!beside || !frame || jobName === this.comparedJob) return;
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
      return this.wanted(store.frame, note, this.rounds.round);
    if (!store.frame || !haveOneSize(store.frame, other)) {
      return {
        frame: undefined,
        view: {layer: 'image', of: '', other: null},
        stops: 0,
        round: null,
        note: 'The two images differ in size, and so have no difference.',
      };
    }
    const layer: Layer = this.mode.mode === 'relative' ? 'relative' : 'difference';
    return {frame: store.frame, view: {layer, of: '', other}, stops: 0, round: null, note};
  }

  private wanted(frame: Frame|undefined, note: string, chosen: number|null): Wanted {
    const {layer, of, stops} = this.controls;
    const view = {layer, of, other: null};
    // Other layers are kept for the present image alone.
    if (of) return {frame, view, stops, round: null, note};
    if (layer !== 'time') return {frame, view, stops, note, round: chosen};
    // Times are recorded over all rounds together.
    return {frame, view, stops, round: null, note: 'No times are kept for this frame.'};
  }

  private onRange(layer: Layer, range: LayerRange|null) {
    const scale = this.scaleOf(layer);
    this.rangeWords = rangeWords(scale, range);
    this.controls.drawLegend(scale, range);
    this.drawNames();
  }

  // The layer whose scale the shown one has.
  private scaleOf(layer: Layer): Layer {
    return layer === 'image' && this.layers.isError(this.controls.of) ? 'error' : layer;
  }

  // Names the two images and their color scales, whose ranges may differ.
  private drawNames() {
    const {frame, beside} = this.store;
    const name = (of: Frame|undefined, range: string) =>
        of ? this.titleOf(of) + (range ? ' · ' + range : '') : '';
    byId('image-name').hidden = !beside;
    setText(byId('image-name'), name(frame, this.rangeWords));
    setText(byId('beside-name'), name(beside, this.besideWords));
  }

  private titleOf(frame: Frame): string {
    const name = frame.name.replace(/\/frames\/.*/, '');
    return (this.store.jobs.get(name)?.title || name) + ' (' + name + '), frame ' +
        frame.frame_number;
  }
}

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
