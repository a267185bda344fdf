// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Error against samples of the selected job, both axes logarithmic: a straight line that falls by
// one half for four times the samples is what path tracing promises.

import {byId} from './dom.js';

const WIDTH = 320;
const HEIGHT = 72;
const MARGIN = 6;
// Points drawn at most; more are thinned.
const POINTS_MAX = 160;

export class ErrorChart {
  constructor(store) {
    this.store = store;
    for (const topic of ['jobs', 'selection']) store.listen(topic, this.draw);
  }

  draw = () => {
    const history = this.store.errorHistory;
    byId('chart-section').hidden = history.length < 2;
    if (history.length < 2) return;
    const stride = Math.ceil(history.length / POINTS_MAX);
    const points = history.filter((_, i) => i % stride === 0 || i === history.length - 1)
                       .map(({samples, mse}) => [Math.log(samples), Math.log(mse) / 2]);
    const [x, y] = [0, 1].map((axis) => scale(points.map((point) => point[axis])));
    const line = points.map(
        ([u, v]) => (MARGIN + x(u) * (WIDTH - 2 * MARGIN)).toFixed(1) + ',' +
            (HEIGHT - MARGIN - y(v) * (HEIGHT - 2 * MARGIN)).toFixed(1));
    byId('chart-line').setAttribute('points', line.join(' '));
    const [endX, endY] = line[line.length - 1].split(',');
    byId('chart-end').setAttribute('cx', endX);
    byId('chart-end').setAttribute('cy', endY);
  };
}

// Maps the range of the values to [0, 1].
function scale(values) {
  const low = Math.min(...values);
  const span = Math.max(...values) - low || 1;
  return (value) => (value - low) / span;
}
