// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Error against samples of the selected job, both axes logarithmic: a straight line that falls by
// one half for four times the samples is what path tracing promises.

import {byId} from './dom';
import type {Store} from './store';

const WIDTH = 320;
const HEIGHT = 72;
const MARGIN = 6;
// Points drawn at most; more are thinned.
const POINTS_MAX = 160;

export class ErrorChart {
  constructor(private readonly store: Store) {
    for (const topic of ['jobs', 'selection'] as const) store.listen(topic, this.draw);
  }

  private readonly draw = () => {
    const history = this.store.errorHistory;
    byId('chart-section').hidden = history.length < 2;
    if (history.length < 2) return;
    const stride = Math.ceil(history.length / POINTS_MAX);
    const points =
        history.filter((_, i) => i % stride === 0 || i === history.length - 1)
            .map(({samples, mse}): [number, number] => [Math.log(samples), Math.log(mse) / 2]);
    const x = scale(points.map(([u]) => u));
    const y = scale(points.map(([, v]) => v));
    const line = points.map(
        ([u, v]) => (MARGIN + x(u) * (WIDTH - 2 * MARGIN)).toFixed(1) + ',' +
            (HEIGHT - MARGIN - y(v) * (HEIGHT - 2 * MARGIN)).toFixed(1));
    byId('chart-line').setAttribute('points', line.join(' '));
    const [endX, endY] = (line.at(-1) ?? ',').split(',');
    byId('chart-end').setAttribute('cx', endX ?? '');
    byId('chart-end').setAttribute('cy', endY ?? '');
  };
}

// Maps the range of the values to [0, 1].
function scale(values: number[]) {
  const low = Math.min(...values);
  const span = Math.max(...values) - low || 1;
  return (value: number) => (value - low) / span;
}
