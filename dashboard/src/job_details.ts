// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The selected job's header: its description, progress and figures.

import * as api from './api';
import type {Frame, Job, Progress} from './api';
import {byId, child, el, setBadge, setProgress, setText} from './dom';
import * as format from './format';
import type {Store} from './store';

export class JobDetailsView {
  constructor(private readonly store: Store) {
    for (const topic of ['jobs', 'frames', 'selection'] as const) store.listen(topic, this.draw);
    // The exposure may have changed since the last drawing.
    byId('output-png').addEventListener('click', this.draw);
  }

  private readonly draw = () => {
    const {job, frame} = this.store;
    byId('details').dataset.empty = job ? 'no' : 'yes';
    setText(byId('details-empty'), emptyWordsOf(this.store));
    if (!job) return;
    setText(byId('job-title'), job.title || job.name);
    setBadge(byId('job-state'), job.state);
    const message =
        job.failure || incompleteWordsOf(frame) || job.waiting_reason || job.warning || '';
    setText(byId('job-message'), message);
    byId('job-message').dataset.failure = job.failure || frame?.incomplete ? 'yes' : 'no';
    byId('job-message').hidden = !message;
    setProgress(byId('job-bar'), format.doneShare(job.progress), job.state);
    const output = byId<HTMLAnchorElement>('output');
    output.hidden = !frame || !frame.complete;
    const png = byId<HTMLAnchorElement>('output-png');
    png.hidden = output.hidden;
    if (frame && frame.complete) {
      output.href = api.outputPath(frame);
      png.href = api.outputPngPath(frame, Number(byId<HTMLInputElement>('exposure').value));
      png.download = pngNameOf(job, frame);
    }
    setText(byId('error-words'), errorWordsOf(job, frame));
    this.drawFacts(job, frame);
  };

  private drawFacts(job: Job, frame: Frame|undefined) {
    const facts = factsOf(job, frame);
    const list = byId('facts');
    if (list.children.length !== facts.length) {
      list.replaceChildren(...facts.map(() => el('div', {class: 'fact'}, el('dt'), el('dd'))));
    }
    facts.forEach(([label, value, title], i) => {
      const row = child(list, i);
      setText(child(row, 0), label);
      setText(child(row, 1), value);
      row.title = title || '';
    });
  }
}

function emptyWordsOf(store: Store): string {
  // The first steps are shown instead.
  if (store.jobs.sorted.length === 0 && !store.jobMissing) return '';
  if (!store.jobMissing) return 'Select a job to see its image.';
  return 'There is no job ' + store.jobName + '. Select another one.';
}

// The selected frame's own text, while its job continues.
function incompleteWordsOf(frame: Frame|undefined): string {
  return frame?.incomplete ? 'Frame ' + frame.frame_number +
          (frame.incomplete.startsWith('killed by ') ?
               ' was given up by ' + frame.incomplete.slice('killed by '.length) :
               ' is incomplete: ' + frame.incomplete) :
                             '';
}

// Samples that came with an image took no time here.
function sampleRateOf(progress: Progress, frame: Frame|undefined): string {
  const wall = progress.wall_duration_seconds;
  if (!(wall > 0) || frame?.resumed_image) return '–';
  return format.count(progress.sample_count_done / wall);
}

function timeLeftOf(progress: Progress): string {
  const left = format.duration(progress.remaining_duration_seconds);
  if (progress.remaining_duration_low_seconds === null) return left;
  return left + ' (' + format.duration(progress.remaining_duration_low_seconds) + ' to ' +
      format.duration(progress.remaining_duration_high_seconds) + ')';
}

function alternativeOf(progress: Progress): string {
  const alone = progress.remaining_duration_alone_seconds;
  const without = alone === null ? '' : '; without them ' + format.duration(alone);
  return 'Takes the farm\'s other jobs into account' + without;
}

// [label, value, explanation] of each figure.
function factsOf(job: Job, frame: Frame|undefined): [string, string, string?][] {
  const progress = job.progress;
  const wall = progress.wall_duration_seconds;
  return [
    ['Done', format.percent(format.doneShare(progress))],
    ['Time left', format.hasEnded(job) ? '–' : timeLeftOf(progress), alternativeOf(progress)],
    ['Time', format.duration(wall), 'Since the first lease, without pauses'],
    [
      'Error', format.typicalError(progress.relative_mse),
      'The typical relative error of a pixel, estimated from replicates; see “What the error means”'
    ],
    ...errorsOfEyes(frame),
    ...targetOf(frame),
    ...certifiedErrorOf(frame),
    ...priceOfErrorBars(frame),
    [
      'FLIP', frame?.flip ? frame.flip.toFixed(3) : '–',
      'Perceived difference between the shown frame and the converged image, from 0 to 1, ' +
          'estimated when the frame is complete'
    ],
    ...firefliesOf(frame),
    ['Samples per pixel', samplesOf(frame), 'Mean over the pixels of the shown frame'],
    ['Samples per second', sampleRateOf(progress, frame)],
    ['Rays per second', wall > 0 ? format.count(progress.ray_count / wall) : '–'],
    [
      'Processor time', format.duration(progress.cpu_duration_seconds),
      'Time that workers spent on accepted results'
    ],
    [
      'NaN/Inf samples', format.exact(progress.nonfinite_count),
      'Samples that are not a number or infinite; anything but 0 is a defect'
    ],
    ...keptOf(job),
  ];
}

// The frame's error is the worse eye's.
function errorsOfEyes(frame: Frame|undefined): [string, string, string][] {
  const left = frame?.left_eye_relative_mse, right = frame?.right_eye_relative_mse;
  if (!left || !right) return [];
  const difference = frame.eye_difference_relative_mse ?? 0;
  return [
    [
      'Left, right eye', format.typicalError(left) + ', ' + format.typicalError(right),
      'The errors of the eyes; the frame’s is the larger'
    ],
    [
      'Difference of the eyes', format.typicalError(difference),
      'The error of the left eye less the right one: √2 times that of an eye if they were ' +
          'independent, and less the more paths they share'
    ],
  ];
}

function targetOf(frame: Frame|undefined): [string, string, string][] {
  const target = frame?.stop.target_error;
  if (!target) return [];
  return [['Target', format.typicalError(target), 'The error at which the shown frame stops']];
}

// The grade of the frame's error: certified, or estimated with the reason.
function certifiedErrorOf(frame: Frame|undefined): [string, string, string][] {
  const certified = frame?.rounds.at(-1)?.certified_relative_mse;
  if (certified) {
    return [[
      'Certified error', 'at most ' + format.typicalError(certified),
      'Holds for any scene in 95 of 100 frames, because ' + frame.certificate
    ]];
  }
  if (!frame?.certificate) return [];
  return [['Grade of the error', 'estimated', 'Not certified: ' + frame.certificate]];
}

// The one scale of errors on the page, and its relation to that of the command line.
function errorWordsOf(job: Job, frame: Frame|undefined): string {
  const now = job.progress.relative_mse ?
      ' Now: ' + format.typicalError(job.progress.relative_mse) + ', relMSE ' +
          format.error(job.progress.relative_mse) + '.' :
      '';
  return '±2 % means: the error of a pixel is typically 2 % of its value (the root mean square ' +
      'over the pixels; dark pixels count against a tenth of the image’s mean). The list, the ' +
      'chart, targets and the layer “Standard error” use the same scale. sheaf submit ' +
      '--target-error 2% stops at it. Scripts and EXR metadata have its square, the relMSE.' + now +
      fireflyWordsOf(frame);
}

// "shot.0007.png".
function pngNameOf(job: Job, frame: Frame): string {
  const title = (job.title || job.name).replace(/\.pbrt$/, '').replace(/[^A-Za-z0-9.-]/g, '_');
  return title + '.' + String(frame.frame_number).padStart(4, '0') + '.png';
}

// Says how much of the job is kept, where that is not the usual.
function keptOf(job: Job): [string, string, string][] {
  if (job.parts_removed_time) {
    return [[
      'Parts', 'removed ' + format.clock(job.parts_removed_time),
      'The coordinator made room on its disk. Refining continues from the image.'
    ]];
  }
  if (job.pinned) return [['Kept', 'pinned', 'All its data stays until sheaf unpin.']];
  return [];
}

function priceOfErrorBars(frame: Frame|undefined): [string, string, string][] {
  if (!frame?.one_sequence_gain) return [];
  return [[
    'Cost of error bars', `${Math.sqrt(frame.one_sequence_gain).toFixed(1)} × error`,
    'The shown frame is smooth: --one-sequence would reduce its error by about this factor, but ' +
        'gives no true error bars (sheaf study measures it)'
  ]];
}

// Where a frame was to stop at an error, fireflies decide whether to trust that it did. Elsewhere
// the words on the error name them.
function firefliesOf(frame: Frame|undefined): [string, string, string][] {
  const words = fireflyWordsOf(frame);
  if (!frame || !words || !frame.stop.target_error) return [];
  const [most] = frame.unreliable_layers;
  const tiles = frame.unreliable_tile_count + ' of ' + frame.tile_count;
  return [['Tiles with fireflies', tiles + (most ? ' (' + most.layer + ')' : ''), words.trim()]];
}

function fireflyWordsOf(frame: Frame|undefined): string {
  if (!frame || !frame.complete || !frame.unreliable_tile_count) return '';
  return ' In ' + frame.unreliable_tile_count + ' of ' + frame.tile_count +
      ' tiles a few very bright samples make most of the noise. The error includes them, but ' +
      'error bars of their pixels may be too small; more samples help. ' + mainCauseOf(frame);
}

function mainCauseOf(frame: Frame|undefined): string {
  const layers = frame?.unreliable_layers ?? [];
  if (!layers.length)
    return 'Layers of kinds of paths (--light-paths) or sheaf study identify the cause.';
  const causes = layers.map(({layer, tile_count}) => `${layer} (${tile_count} tiles)`);
  return 'Main cause: ' + causes.join(', then ') + '.';
}

function samplesOf(frame: Frame|undefined): string {
  if (!frame) return '–';
  const {window} = frame;
  const pixels = (window.x1_px - window.x0_px) * (window.y1_px - window.y0_px);
  const mean = pixels > 0 ? frame.progress.sample_count_done / pixels : 0;
  const done = mean < 10 ? mean.toFixed(1) : format.exact(Math.floor(mean));
  const all = format.exact(frame.sample_count);
  return frame.stop.target_error ? done + ' (at most ' + all + ')' : done + ' of ' + all;
}
