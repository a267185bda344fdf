// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The histogram of the shown image: light over stops, with the white of the screen at the present
// exposure; false colors over the scale of the legend.

import {byId, setText} from './dom';
import * as format from './format';
import {LOG_BINS, LOG_HIGH, LOG_LOW} from './light_bins';
import type {Histogram} from './light_bins';

// Stops between two marks of the axis.
const MARK_STOPS = 4;

export class HistogramView {
  private readonly canvas = byId<HTMLCanvasElement>('histogram');
  private histogram: Histogram|null = null;
  private stops = 0;

  constructor() {
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  // Null: not known.
  show(histogram: Histogram|null, stops: number) {
    this.histogram = histogram;
    this.stops = stops;
    this.draw();
  }

  private draw() {
    const {canvas, histogram} = this;
    const width = Math.round(canvas.clientWidth * devicePixelRatio);
    const height = Math.round(canvas.clientHeight * devicePixelRatio);
    if (width === 0 || height === 0) return;
    canvas.width = width;
    canvas.height = height;
    const context = canvas.getContext('2d');
    if (!context || !histogram) return;
    const style = getComputedStyle(canvas);
    const color = (name: string) => style.getPropertyValue(name).trim();
    const colors = histogram.isLight ? ['--red', '--green', '--blue'] : ['--text'];
    // The ends hold everything beyond them, and would hide the rest.
    const most = Math.max(1, ...histogram.counts.map((row) => Math.max(...row.subarray(1, -1))));
    // Overlapping bars of red, green and blue add up to white or subtract to black.
    const isDark = document.documentElement.dataset.theme === 'dark';
    context.globalCompositeOperation = isDark ? 'lighter' : 'multiply';
    histogram.counts.forEach((row, i) => {
      context.fillStyle = color(colors[i] ?? '--text');
      const step = width / row.length;
      row.forEach((count, bin) => {
        const bar = Math.min(1, Math.sqrt(count / most)) * height;
        context.fillRect(bin * step, height - bar, Math.ceil(step), bar);
      });
    });
    context.globalCompositeOperation = 'source-over';
    if (histogram.isLight) this.drawStops(context, width, height, color);
    setText(byId('histogram-words'), wordsOf(histogram, this.stops));
  }

  // A dashed line at what the screen shows as white.
  private drawStops(
      context: CanvasRenderingContext2D, width: number, height: number,
      color: (name: string) => string) {
    const at = (stop: number) => (stop - LOG_LOW) / (LOG_HIGH - LOG_LOW) * width;
    context.fillStyle = color('--quiet');
    for (let stop = LOG_LOW + MARK_STOPS; stop < LOG_HIGH; stop += MARK_STOPS)
      context.fillRect(
          Math.round(at(stop)), height - 4 * devicePixelRatio, 1, 4 * devicePixelRatio);
    context.fillStyle = color('--accent');
    const white = Math.round(at(-this.stops));
    for (let y = 0; y < height; y += 8 * devicePixelRatio)
      context.fillRect(white - 1, y, 2, 4 * devicePixelRatio);
  }
}

function wordsOf(histogram: Histogram, stops: number): string {
  if (!histogram.isLight) return 'Pixels over the colors of the scale.';
  let all = 0, above = 0;
  const first = Math.ceil((-stops - LOG_LOW) * LOG_BINS);
  for (const row of histogram.counts) {
    row.forEach((count, bin) => {
      all += count;
      if (bin >= first) above += count;
    });
  }
  return 'Red, green and blue from ' + format.signed(LOG_LOW) + ' to ' + LOG_HIGH +
      ' stops, a mark every ' + MARK_STOPS + '. ' + format.share(all > 0 ? above / all : 0) +
      ' of the values are brighter than the screen’s white (dashed).';
}
