// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The viewer: the image of the shown frame and, for comparison, another one beside it. Both use the
// same layer and exposure and show the same region.

import type {Frame, Job, Layer, LayerRange} from './api';
import {CompareChoice} from './compare_choice';
import {byId, setText} from './dom';
import {ImagePane} from './image_pane';
import {linkViewports} from './image_viewport';
import {RoundSlider} from './round_slider';
import type {Store} from './store';
import {ViewerControls, rangeWords} from './viewer_controls';

export class ImageView {
  private readonly pane: ImagePane;
  private readonly beside: ImagePane;
  private readonly controls: ViewerControls;
  private readonly rounds = new RoundSlider(() => this.pane.hurry());
  private readonly choice: CompareChoice;
  private job: string|null = null;
  private rangeWords = '';
  private besideWords = '';

  constructor(private readonly store: Store) {
    this.pane = new ImagePane(store, {
      name: 'image',
      wanted: () => this.wanted(store.frame, noteOf(store.job, store.frame), this.rounds.round),
      onView: () => this.controls.drawZoom(),
      onRange: (layer, range) => this.onRange(layer, range),
    });
    this.beside = new ImagePane(store, {
      name: 'beside',
      wanted: () => this.wanted(store.beside, 'No image yet.', null),
      onView: () => {},
      onRange: (layer, range) => {
        this.besideWords = rangeWords(layer, range);
        this.drawNames();
      },
    });
    this.controls = new ViewerControls(this.pane.viewport, () => {
      this.pane.hurry();
      this.beside.hurry();
    });
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
    this.rounds.show(frame);
    this.pane.draw();
    this.drawNames();
  };

  private readonly drawBeside = () => {
    const {beside} = this.store;
    byId('images').dataset.compare = beside ? 'yes' : 'no';
    byId('beside-box').hidden = !beside;
    this.choice.draw();
    this.beside.draw();
    this.drawNames();
  };

  private wanted(frame: Frame|undefined, note: string, chosen: number|null) {
    const {layer, stops} = this.controls;
    if (layer !== 'time') return {frame, layer, stops, note, round: chosen};
    // Times are recorded over all rounds together.
    return {frame, layer, stops, round: null, note: 'No times are kept for this frame.'};
  }

  private onRange(layer: Layer, range: LayerRange|null) {
    this.rangeWords = rangeWords(layer, range);
    this.controls.drawLegend(layer, range);
    this.drawNames();
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

function noteOf(job: Job|undefined, frame: Frame|undefined): string {
  if (!job) return 'Select a job to see its image.';
  if (job.waiting_reason) return 'Waiting: ' + job.waiting_reason.replace(/^waiting /, '');
  if (job.state === 'paused') return 'Paused before the first samples.';
  return frame ? 'No samples yet.' : '';
}
