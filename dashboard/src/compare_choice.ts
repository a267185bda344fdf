// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Chooses what to show beside the image: a frame of any job, or another layer of the shown frame.
// The list of jobs is fetched when the user opens it, because it changes all the time.

import * as api from './api';
import type {Frame} from './api';
import {byId, el} from './dom';
import type {Store} from './store';

// Limits of the lists: jobs, and frames of one job.
const JOBS_MAX = 200;
const FRAMES_MAX = 1000;
const ATTEMPT = 'loading the compared frame';
// The option for a layer of the shown frame.
const OWN = 'own';
// The layer as it is in the shown image.
export const SAME_LAYER = '';

export class CompareChoice {
  private readonly jobs = byId<HTMLSelectElement>('beside-job');
  private readonly numbers = byId<HTMLSelectElement>('beside-frame');
  private readonly layer = byId<HTMLSelectElement>('beside-layer');
  private frames: Frame[] = [];

  // onLayer: another layer of the compared frame was chosen.
  constructor(private readonly store: Store, private readonly onLayer: () => void) {
    for (const event of ['focus', 'pointerdown'] as const) {
      this.jobs.addEventListener(event, () => this.listJobs());
    }
    this.jobs.addEventListener('change', () => void this.chooseJob(this.jobs.value));
    this.layer.addEventListener('focus', () => this.listLayers());
    this.layer.addEventListener('change', () => this.onLayer());
    this.numbers.addEventListener('change', () => {
      store.setBeside(this.frames.find((frame) => frame.name === this.numbers.value));
    });
    // Events may have been missed.
    store.listen('connection', () => void this.refresh());
    this.jobs.replaceChildren(...fixedOptions());
    this.listLayers();
  }

  draw() {
    const {beside} = this.store;
    this.numbers.hidden = !beside || this.isOwn || this.frames.length < 2;
    this.layer.hidden = !beside;
    if (!beside) this.jobs.value = '';
    if (!beside) this.layer.value = SAME_LAYER;
  }

  // Whether a layer of the shown frame is compared.
  get isOwn(): boolean {
    return this.jobs.value === OWN;
  }

  // The layer of the compared frame; SAME_LAYER for that of the shown one.
  get layerValue(): string {
    return this.store.beside ? this.layer.value : SAME_LAYER;
  }

  // A layer of the shown frame stays beside it when another frame is shown.
  follow() {
    const {beside, frame} = this.store;
    if (beside && frame && this.isOwn && beside.name !== frame.name) this.store.setBeside(frame);
  }

  // Shows a layer of the shown frame beside it, or nothing where it is there already.
  toggleOwn(value: string) {
    const isShown = this.store.beside && this.isOwn && this.layer.value === value;
    this.jobs.value = isShown ? '' : OWN;
    void this.chooseJob(this.jobs.value);
    if (isShown) return;
    this.layer.value = value;
    this.onLayer();
  }

  private listJobs() {
    const {value} = this.jobs;
    const jobs = this.store.jobs.sorted.slice(0, JOBS_MAX);
    const chosen = this.store.jobs.get(value);
    if (chosen && !jobs.includes(chosen)) jobs.push(chosen);
    this.jobs.replaceChildren(
        ...fixedOptions(),
        ...jobs.map(
            (job) =>
                el('option', {value: job.name}, (job.title || job.name) + ' (' + job.name + ')')));
    this.jobs.value = value;
  }

  // The layers that are offered for the shown image.
  private listLayers() {
    const {value} = this.layer;
    const options = [...byId<HTMLSelectElement>('layer').options];
    this.layer.replaceChildren(
        el('option', {value: SAME_LAYER}, 'same layer'),
        ...options.map((option) => el('option', {value: option.value}, option.text)));
    this.layer.value = value;
    if (this.layer.selectedIndex < 0) this.layer.value = SAME_LAYER;
  }

  private async chooseJob(name: string) {
    if (!name) return this.store.setBeside(undefined);
    this.store.note(ATTEMPT, null);
    this.listLayers();
    if (name === OWN) return this.chooseOwn();
    try {
      const job = await api.getJob(name, FRAMES_MAX, '');
      if (this.jobs.value !== name) return;
      this.frames = job.frames;
      this.numbers.replaceChildren(...job.frames.map(
          (frame) => el('option', {value: frame.name}, 'frame ' + frame.frame_number)));
      // Prefer the shown frame's number, in case the job is another version of the same shot.
      const number = this.store.frame?.frame_number;
      const frame = job.frames.find((one) => one.frame_number === number) ?? job.frames[0];
      if (frame) this.numbers.value = frame.name;
      this.layer.value = SAME_LAYER;
      this.store.setBeside(frame);
    } catch (failure) {
      this.store.note(ATTEMPT, failure);
    }
  }

  // The denoised layer beside the image, or the errors where there is none.
  private chooseOwn() {
    const {value} = byId<HTMLSelectElement>('layer');
    const values = [...this.layer.options].map((option) => option.value);
    this.layer.value =
        ['of:denoised', 'error', 'image'].find((one) => one !== value && values.includes(one)) ??
        '';
    this.store.setBeside(this.store.frame);
  }

  private async refresh() {
    const name = this.store.beside?.name;
    if (!name || this.store.connection !== 'live') return;
    try {
      const frame = await api.getFrame(name);
      if (this.store.beside?.name === name) this.store.setBeside(frame);
    } catch {
      // The frame may have been lost with an earlier coordinator.
      if (this.store.beside?.name === name) this.store.setBeside(undefined);
    }
  }
}

const fixedOptions = () =>
    [el('option', {value: ''}, 'nothing'), el('option', {value: OWN}, 'a layer of this image')];
