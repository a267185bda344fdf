// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Submits a scene whose files are dropped anywhere on the page, or chosen: asks for what a scene
// leaves open, shows the files being sent, and then the job or what is wrong with the scene.

import {getSession} from './api';
import {byId, el, setProgress, setText} from './dom';
import {filesOfDrop, filesOfInput} from './dropped_files';
import type {DroppedFile} from './dropped_files';
import type {Store} from './store';
import {getOffer, Submission} from './submission';
import type {Offer, SubmissionState} from './submission';
import {withoutUsd} from './usd_files';

const ATTEMPT = 'submitting a scene';
const DROP_WORDS = 'Drop a scene: its files, their folder, or a zip file';
const PICK_WORDS = 'Drop a .pbrt, .gltf, .glb or USD file with the files that it names, their ' +
    'folder, or a zip file of it.';

// pick: no files yet; ready: files that can be submitted; busy: they are sent or read; choose: the
// scene among them; ended: there is a job, or none can be made.
type Phase = 'pick'|'ready'|'busy'|'choose'|'ended';

export class SubmitDialog {
  private readonly dialog = byId<HTMLDialogElement>('submit-dialog');
  private readonly overlay = byId('drop-overlay');
  private readonly bar = byId('submit-bar');
  private readonly scene = byId<HTMLSelectElement>('submit-scene');
  private phase: Phase = 'pick';
  private files: DroppedFile[] = [];
  private submission: Submission|null = null;
  private offer: Offer|null = null;
  // The parts that the files' conversion left out.
  private notes: string[] = [];
  // Why this user cannot submit; empty: they can.
  private whyNot = '';

  constructor(private readonly store: Store, private readonly select: (job: string) => void) {
    byId('submit-open').addEventListener('click', () => this.open([]));
    byId('submit-no').addEventListener('click', () => this.dialog.close());
    this.dialog.addEventListener('close', () => this.forget());
    byId<HTMLFormElement>('submit-form').addEventListener('submit', (event) => {
      event.preventDefault();
      void this.submit();
    });
    for (const kind of ['files', 'folder']) {
      const input = byId<HTMLInputElement>('submit-' + kind + '-input');
      byId('submit-' + kind).addEventListener('click', () => input.click());
      input.addEventListener('change', () => {
        this.open(filesOfInput(input));
        input.value = '';
      });
    }
    addEventListener('dragover', this.onDrag);
    addEventListener('dragleave', (event) => {
      if (event.relatedTarget === null) this.overlay.hidden = true;
    });
    addEventListener('drop', (event) => void this.onDrop(event));
    void this.ask();
  }

  private async ask() {
    try {
      const [offer, session] = await Promise.all([getOffer(), getSession()]);
      this.offer = offer;
      this.whyNot = session.role === 'view' ? 'it takes the role submit' : offer.why_not;
      byId('submit-open').hidden = this.whyNot !== '';
    } catch (failure) {
      this.store.note('asking what can be submitted', failure);
    }
  }

  private readonly onDrag = (event: DragEvent) => {
    if (!event.dataTransfer?.types.includes('Files')) return;
    event.preventDefault();
    const possible = this.offer !== null && this.whyNot === '' && this.phase !== 'busy';
    event.dataTransfer.dropEffect = possible ? 'copy' : 'none';
    setText(
        byId('drop-words'),
        possible                ? DROP_WORDS :
            this.whyNot         ? 'No scene can be submitted here: ' + this.whyNot :
            this.offer === null ? 'Connecting …' :
                                  'Wait until the other scene is submitted');
    this.overlay.hidden = false;
  };

  private async onDrop(event: DragEvent) {
    if (!event.dataTransfer?.types.includes('Files')) return;
    event.preventDefault();
    this.overlay.hidden = true;
    if (!this.offer || this.whyNot || this.phase === 'busy') return;
    this.store.note(ATTEMPT, null);
    try {
      this.open(await filesOfDrop(event.dataTransfer, this.offer.files_max));
    } catch (failure) {
      this.store.note(ATTEMPT, failure);
    }
  }

  private open(files: DroppedFile[]) {
    if (this.phase === 'busy') return;
    this.forget();
    this.files = files;
    this.phase = files.length > 0 ? 'ready' : 'pick';
    const bytes = this.bytes();
    if (this.offer && bytes > this.offer.bytes_max) {
      this.phase = 'pick';
      this.say(
          'The files have ' + sizeOf(bytes) + ', the limit is ' + sizeOf(this.offer.bytes_max) +
          '; use sheaf submit.');
    }
    this.draw();
    if (!this.dialog.open) {
      byId<HTMLFormElement>('submit-form').reset();
      this.dialog.showModal();
    }
    byId(this.phase === 'pick' ? 'submit-files' : 'submit-yes').focus();
  }

  // Ends the transfers in progress and forgets the files.
  private forget() {
    void this.submission?.stop();
    this.submission = null;
    this.files = [];
    this.notes = [];
    this.phase = 'pick';
    this.say('');
  }

  private bytes(): number {
    return this.files.reduce((sum, {file}) => sum + file.size, 0);
  }

  private say(state: string, messages = '') {
    setText(byId('submit-state'), state);
    setText(byId('submit-messages'), messages);
    byId('submit-messages').hidden = messages === '';
  }

  private draw() {
    const {phase} = this;
    setText(
        byId('submit-words'),
        this.files.length === 0     ? PICK_WORDS :
            this.files.length === 1 ? (this.files[0]?.name ?? '') + ', ' + sizeOf(this.bytes()) :
                                      this.files.length + ' files, ' + sizeOf(this.bytes()));
    byId('submit-pick').hidden = phase !== 'pick' && phase !== 'ready';
    byId('submit-scene-box').hidden = phase !== 'choose';
    this.bar.hidden = phase !== 'busy';
    byId('submit-yes').hidden = phase === 'ended';
    byId<HTMLButtonElement>('submit-yes').disabled = phase !== 'ready' && phase !== 'choose';
    setText(byId('submit-no'), phase === 'ended' ? 'Close' : 'Cancel');
    for (const id of ['submit-name', 'submit-samples', 'submit-error'])
      byId<HTMLInputElement>(id).disabled = phase === 'busy' || phase === 'ended';
  }

  private async submit() {
    if (!this.offer || (this.phase !== 'ready' && this.phase !== 'choose')) return;
    const chosen = this.phase === 'choose' ? this.scene.value : '';
    this.phase = 'busy';
    this.draw();
    const submission = this.submission ??= new Submission(this.offer);
    try {
      if (chosen === '') await this.send(submission);
      this.say('The scene is being read …');
      const state = await submission.read({
        scene: chosen,
        title: valueOf('submit-name'),
        samples: valueOf('submit-samples'),
        target_error: relativeMseOf(valueOf('submit-error')),
      });
      if (this.submission === submission) this.show(state);
    } catch (failure) {
      if (this.submission === submission) this.end('The scene was not submitted', failure);
    }
  }

  private async send(submission: Submission) {
    setProgress(this.bar, 0, 'running');
    this.say('The files are being read …');
    const {files, notes} = await withoutUsd(this.files);
    if (this.submission !== submission) return;
    this.files = files;
    this.notes = notes;
    const total = Math.max(1, this.bytes());
    this.say('The files are being sent …');
    await submission.send(this.files, (sent) => setProgress(this.bar, sent / total, 'running'));
  }

  private show({state, scenes, messages: said, job}: SubmissionState) {
    const messages = [...this.notes, said].filter((one) => one !== '').join('\n');
    if (state === 'choosing') {
      this.scene.replaceChildren(...scenes.map((scene) => el('option', {}, scene)));
      this.phase = 'choose';
      this.say('There are several scenes: choose one.');
      this.draw();
      this.scene.focus();
      return;
    }
    this.phase = 'ended';
    if (job) {
      this.say('Submitted as ' + job + (messages ? ', with notes:' : '.'), messages);
      this.select(job);
    } else {
      this.say('The scene was refused:', messages);
    }
    this.draw();
    byId('submit-no').focus();
  }

  private end(words: string, failure: unknown) {
    this.phase = 'ended';
    this.say(words + ':', failure instanceof Error ? failure.message : `${failure}`);
    this.draw();
  }
}

const valueOf = (id: string) => byId<HTMLInputElement>(id).value.trim();

// "12 bytes", "3.4 MB".
function sizeOf(bytes: number): string {
  if (bytes < 1000) return bytes + (bytes === 1 ? ' byte' : ' bytes');
  const units = ['kB', 'MB', 'GB', 'TB'];
  let value = bytes;
  let unit = '';
  for (const next of units) {
    if (value < 1000) break;
    value /= 1000;
    unit = next;
  }
  return value.toFixed(value < 10 ? 1 : 0) + ' ' + unit;
}

// The API takes the square of the typical error of a pixel, which people give in percent.
function relativeMseOf(percent: string): string {
  return percent === '' ? '' : String((Number(percent) / 100) ** 2);
}
