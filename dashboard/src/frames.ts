// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The frames of the selected job as a grid of thumbnails that update while they are rendered.

import type {Frame} from './api';
import {byId, child, el, setText} from './dom';
import * as format from './format';
import type {Store} from './store';
import {Thumbnails} from './thumbnails';
import {VirtualList} from './virtual_list';

export class FramesView {
  private readonly grid: VirtualList<Frame>;
  private readonly thumbnails = new Thumbnails();
  private job: string|null = null;

  constructor(private readonly store: Store, select: (name: string) => void, loadMore: () => void) {
    this.grid = new VirtualList(byId('frames'), {
      label: 'Frames',
      rowHeightProperty: '--frame-row',
      cellWidthProperty: '--frame-cell',
      makeRow,
      updateRow: (cell, frame) => this.updateCell(cell, frame),
      keyOf: (frame) => frame.name,
      onSelect: (frame) => select(frame.name),
    });
    byId('frames-more').addEventListener('click', loadMore);
    for (const topic of ['frames', 'selection'] as const) store.listen(topic, this.draw);
  }

  private readonly draw = () => {
    if (this.job !== this.store.jobName) this.thumbnails.clear();
    this.job = this.store.jobName;
    const frames = this.store.frames.sorted;
    byId('frames-section').hidden = frames.length < 2;
    byId('frames-more').hidden = !this.store.framesToken;
    setText(byId('frames-count'), countsOf(frames, this.store.job?.frame_count ?? 0));
    this.grid.setItems(frames, this.store.frame?.name ?? null);
  };

  private updateCell(cell: HTMLElement, frame: Frame) {
    const share = format.doneShare(frame.progress);
    const [image, bar, words] = [child(cell, 0), child(cell, 1), child(cell, 2)];
    this.thumbnails.show(image as HTMLImageElement, frame);
    child(bar, 0).style.width = share * 100 + '%';
    const complete = frame.complete ? 'yes' : 'no';
    if (cell.dataset.complete !== complete) cell.dataset.complete = complete;
    setText(child(words, 0), String(frame.frame_number));
    const state = stateOf(frame, share);
    setText(child(words, 1), state);
    const label = 'Frame ' + frame.frame_number + ', ' + (state || 'complete');
    if (cell.title !== label) {
      cell.title = label;
      cell.setAttribute('aria-label', label);
    }
  }
}

function makeRow(): HTMLElement {
  return el(
      'div', {class: 'frame'}, Thumbnails.make(),
      el('div', {class: 'bar frame-bar'}, el('div', {class: 'bar-fill'})),
      el('div', {class: 'frame-words'}, el('span'), el('span')));
}

function stateOf(frame: Frame, share: number): string {
  if (frame.complete) return '';
  if (frame.training) return 'training';
  return share > 0 || frame.preview_version > 0 ? format.percent(share) : 'waiting';
}

// "3 of 24 complete".
function countsOf(frames: readonly Frame[], all: number): string {
  const complete = frames.filter((frame) => frame.complete).length;
  const loaded = frames.length < all ? ' of the first ' + frames.length : '';
  return complete + ' of ' + all + ' complete' + loaded;
}
