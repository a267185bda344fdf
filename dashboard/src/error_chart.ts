// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Error against samples per pixel or time of the shown job on logarithmic axes. Path tracing should
// give a straight line that falls by one half for four times the samples. The dotted line
// extrapolates the last points; the dashed line marks the frame's target error, if it has one. The
// compared job has a line of its own.

import 'uplot/dist/uPlot.min.css';

import uPlot from 'uplot';

import type {CurvePoint, PowerLaw} from './curve';
import {fitPowerLaw} from './curve';
import {byId, setText} from './dom';
import * as format from './format';
import {labelled, ticksOf} from './log_ticks';
import {pixelsOf} from './store';
import type {Store} from './store';

interface Size {
  width: number;
  height: number;
}

type Abscissa = 'samples'|'seconds'|'cpu';

// The line is fitted to the points within this factor of the last x, which spans two halvings of
// the error.
const FIT_SPAN = 16;
const FIT_POINTS_MIN = 3;
// Points closer together than this factor in x do not determine the trend.
const FIT_SPAN_MIN = 1.25;
// A steeper line is noise: the error of path tracing falls with an exponent of -0.5.
const EXPONENT_MIN = -2;
// How far the line is extrapolated, as a factor of x: without a target, and at most with a target.
const REACH = 4;
const REACH_MAX = 1000;

interface Axis {
  // pixels: those that the point's samples are of.
  of: (point: CurvePoint, pixels: number) => number;
  tick: (value: number) => string;
  // "with 64 samples per pixel".
  words: (value: number) => string;
}

const ABSCISSAS: Record<Abscissa, Axis> = {
  samples: {
    of: (point, pixels) => point.sampleCount / pixels,
    tick: format.roundNumber,
    words: (value) => 'with ' + format.roundNumber(value) + ' samples per pixel',
  },
  seconds: {
    of: (point) => point.wallSeconds,
    tick: format.roundDuration,
    words: (value) => 'after ' + format.duration(value),
  },
  cpu: {
    of: (point) => point.cpuSeconds,
    tick: format.roundDuration,
    words: (value) => 'for ' + format.duration(value) + ' of processor time',
  },
};

const AXIS_FONT_REM = 0.75;
// Margin beyond the highest and lowest value, as a factor.
const MARGIN = 1.15;
// Least part of an axis on each side of its middle, as a factor: any such range has a label.
const SPAN_MIN = 2;

// The data to draw: measured positions and errors, and the end of the extrapolated line.
interface Curve {
  xs: number[];
  errors: number[];
  // The end of the line; null if unknown.
  end: {x: number; error: number}|null;
  // 0 for none.
  target: number;
  // Those of the compared job; empty without one.
  besideXs: number[];
  besideErrors: number[];
}

export class ErrorChart {
  private readonly host = byId('chart');
  private plot: uPlot|null = null;
  private abscissa: Abscissa = 'samples';
  // Gives access to colors of the style sheet.
  private readonly style = getComputedStyle(document.documentElement);
  private readonly colors = new Map<string, string>();
  // Size of the box; null until it is first shown.
  private size: Size|null = null;
  // The drawn data as text, to detect changes.
  private drawn = '';

  constructor(private readonly store: Store) {
    for (const topic of ['jobs', 'frames', 'selection', 'beside'] as const) {
      store.listen(topic, this.draw);
    }
    for (const input of document.querySelectorAll<HTMLInputElement>('input[name="abscissa"]')) {
      input.addEventListener('change', () => {
        this.abscissa = input.value as Abscissa;
        this.draw();
      });
    }
    new ResizeObserver((entries) => this.onSize(entries)).observe(this.host);
    this.draw();
    new MutationObserver(() => {
      this.colors.clear();
      this.plot?.redraw();
    }).observe(document.documentElement, {attributeFilter: ['data-theme']});
  }

  private readonly draw = () => {
    const {points} = this.store.curve;
    const other = this.store.besideCurve?.points ?? [];
    const key = [
      this.store.jobName, points.length, points.at(-1)?.sampleCount, this.abscissa,
      this.store.targetError, this.store.beside?.name, other.length, other.at(-1)?.sampleCount
    ].join();
    if (key === this.drawn) return;
    this.drawn = key;
    const curve = this.makeCurve(points, other);
    byId('chart-section').hidden = curve.xs.length < 2;
    if (curve.xs.length < 2) return;
    const data = dataOf(curve);
    if (this.plot)
      this.plot.setData(data);
    else if (this.size)
      this.plot = new uPlot(this.options(this.size), data, this.host);
    else
      this.drawn = '';
    setText(byId('chart-words'), wordsOf(curve, this.abscissa));
  };

  private makeCurve(points: readonly CurvePoint[], other: readonly CurvePoint[]): Curve {
    const {abscissa, store} = this;
    const {xs, errors} = columnsOf(points, abscissa, store.curvePixels);
    const beside = columnsOf(other, abscissa, pixelsOf(store.beside));
    return {
      xs,
      errors,
      end: endOf(xs, errors, store.targetError),
      target: store.targetError,
      besideXs: beside.xs,
      besideErrors: beside.errors,
    };
  }

  // Looked up once per theme: each query may make the browser recompute all styles.
  private colorOf(name: string): string {
    const found = this.colors.get(name) ?? this.style.getPropertyValue(name);
    this.colors.set(name, found);
    return found;
  }

  // The observer provides the size; querying it would force a layout.
  private onSize(entries: ResizeObserverEntry[]) {
    const box = entries.at(-1)?.contentRect;
    if (!box || box.width < 1 || box.height < 1) return;
    this.size = {width: box.width, height: box.height};
    if (this.plot)
      this.plot.setSize(this.size);
    else
      this.draw();
  }

  private options(size: Size): uPlot.Options {
    const color = (name: string) => () => this.colorOf(name);
    const rem = parseFloat(this.style.fontSize);
    const axis = (words: (value: number) => string): uPlot.Axis => ({
      stroke: color('--quiet'),
      grid: {stroke: color('--panel-edge'), width: 1},
      ticks: {stroke: color('--panel-edge'), width: 1, size: 4},
      font: (AXIS_FONT_REM * rem) + 'px system-ui, sans-serif',
      splits: (_, __, low, high) => ticksOf(low, high),
      filter: (_, splits) => labelled(splits),
      // Ticks without a label are null.
      values: (_, splits) => splits.map((value: number|null) => value === null ? '' : words(value)),
    });
    return {
      ...size,
      legend: {show: false},
      cursor: {drag: {x: false, y: false}},
      padding: [0.5 * rem, 1.7 * rem, 0, 0],
      scales: {x: {time: false, distr: 3, range}, y: {distr: 3, range}},
      axes: [
        {...axis((value) => ABSCISSAS[this.abscissa].tick(value)), size: 2 * rem},
        {...axis(format.share), size: 3.7 * rem},
      ],
      series: [
        {},
        {stroke: color('--accent'), width: 2, points: {show: false}, spanGaps: true},
        {stroke: color('--accent'), width: 2, dash: [2, 5], points: {show: false}, spanGaps: true},
        {stroke: color('--good'), width: 1.5, dash: [8, 5], points: {show: false}},
        {stroke: color('--calm'), width: 2, points: {show: true, size: 5}, spanGaps: true},
      ],
    };
  }
}

function columnsOf(points: readonly CurvePoint[], abscissa: Abscissa, pixels: number) {
  const {of} = ABSCISSAS[abscissa];
  const xs: number[] = [];
  const errors: number[] = [];
  for (const point of points) {
    // The chart needs strictly ascending x; time may not advance between two points.
    if (!(of(point, pixels) > (xs.at(-1) ?? 0))) continue;
    xs.push(of(point, pixels));
    errors.push(Math.sqrt(point.relativeMse));
  }
  return {xs, errors};
}

function endOf(xs: number[], errors: number[], target: number): {x: number; error: number}|null {
  const last = xs.at(-1);
  if (last === undefined) return null;
  const recent =
      xs.map((x, i): [number, number] => [x, errors[i] ?? 0]).filter(([x]) => x * FIT_SPAN >= last);
  const law = recent.length < FIT_POINTS_MIN ? null : fitPowerLaw(recent);
  const first = recent[0]?.[0] ?? last;
  // An error that does not fall gives no extrapolation.
  if (!law || last < FIT_SPAN_MIN * first || law.exponent >= 0 || law.exponent < EXPONENT_MIN) {
    return null;
  }
  const x = last * reachOf(law, last, target);
  return {x, error: law.y0 * (x / law.x0) ** law.exponent};
}

// How far the line is drawn: to the target if it can be reached.
function reachOf(law: PowerLaw, last: number, target: number): number {
  const toTarget = target > 0 ? (target / law.y0) ** (1 / law.exponent) * law.x0 / last : 0;
  return toTarget > 1 ? Math.min(REACH_MAX, toTarget) : REACH;
}

// Columns of the chart: x, measured, extrapolated, target, compared.
function dataOf(curve: Curve): uPlot.AlignedData {
  const {xs, errors, end, target, besideXs, besideErrors} = curve;
  const allX = [...new Set([...xs, ...end ? [end.x] : [], ...besideXs])].sort((a, b) => a - b);
  const column = (of: readonly number[], values: readonly number[]) => {
    const byX = new Map(of.map((x, i) => [x, values[i] ?? null]));
    return allX.map((x) => byX.get(x) ?? null);
  };
  const last = xs.length - 1;
  const extrapolated =
      end ? column([xs[last] ?? 0, end.x], [errors[last] ?? 0, end.error]) : allX.map(() => null);
  return [
    allX, column(xs, errors), extrapolated, allX.map(() => target > 0 ? target : null),
    column(besideXs, besideErrors)
  ];
}

// Slightly more than the drawn range; null if there is no data.
function range(_: uPlot, low: number|null, high: number|null): [number, number] {
  if (low === null || high === null) return [1, 10];
  // A young curve gets room for an octave, so that an axis has labels.
  const middle = Math.sqrt(low * high);
  return [Math.min(low / MARGIN, middle / SPAN_MIN), Math.max(high * MARGIN, middle * SPAN_MIN)];
}

// A description of the chart in one sentence, also for people who cannot see it.
function wordsOf(curve: Curve, abscissa: Abscissa): string {
  const {xs, errors, end, target, besideXs, besideErrors} = curve;
  const {words} = ABSCISSAS[abscissa];
  const now = 'Now ±' + format.share(errors.at(-1) ?? 0) + ' ' + words(xs.at(-1) ?? 0);
  const aim = target > 0 ? '; target ±' + format.share(target) : '';
  const lead =
      end ? '; dotted: extrapolated to ±' + format.share(end.error) + ' ' + words(end.x) : '';
  const other = besideXs.length > 0 ? '; compared job: ±' + format.share(besideErrors.at(-1) ?? 0) +
          ' ' + words(besideXs.at(-1) ?? 0) :
                                      '';
  return now + aim + lead + other + '.';
}
