// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Error against CPU time of every entry on logarithmic axes: a line with error bars for each, the
// Pareto front, and the bias floors.

import {el} from '../dom';

import * as numbers from './numbers';
import {isKnown} from './numbers';
import type {Scale} from './scale';
import {logScale} from './scale';
import type {Entry, Point, Study} from './schema';
import type {Series} from './svg';
import {seriesAt, svg, swatch} from './svg';
import type {Tip} from './tips';
import {Tips} from './tips';

interface PlacedPoint extends Point {
  cpu_seconds: number;
  relative_mse: number;
}

interface Line {
  entry: Entry;
  series: Series;
  // By ascending time.
  points: PlacedPoint[];
  isShown: boolean;
}

interface Plot {
  width: number;
  height: number;
  rem: number;
  x: (seconds: number) => number;
  y: (error: number) => number;
  xScale: Scale;
  yScale: Scale;
}

const ID = 'chart-error';
const EMPTY = 'No error was measured, so there is nothing to plot against time.';
// Height of the chart over its width, and the limits of the height.
const ASPECT = 0.55;
const HEIGHT_REM_MIN = 20;
const HEIGHT_REM_MAX = 38;
// Margins of the plot: top, right, bottom, left.
const ROOM_REM = [0.8, 1.2, 3.2, 4.2] as const;
// The error of the reference is drawn if it is at most this factor below the points.
const REFERENCE_REACH = 30;

const isPlaced = (point: Point): point is PlacedPoint => isKnown(point.cpu_seconds) &&
    isKnown(point.relative_mse) && point.cpu_seconds > 0 && point.relative_mse > 0;

const floorOf = ({bias_floor: floor}: Entry) => floor?.is_significant ? floor.relative_mse : null;

export function errorTimeChart(study: Study): HTMLElement {
  const lines = study.entries.map(
      (entry, i): Line => ({
        entry,
        series: seriesAt(i),
        points: entry.points.filter(isPlaced).sort((a, b) => a.cpu_seconds - b.cpu_seconds),
        isShown: true,
      }));
  const count = lines.reduce((sum, line) => sum + line.points.length, 0);
  if (!count) return el('p', {id: ID, class: 'empty', 'data-count': '0'}, EMPTY);
  return new ErrorTimeChart(study, lines).element(count);
}

class ErrorTimeChart {
  private readonly plot = el('div', {
    class: 'error-plot',
    role: 'group',
    'aria-label': 'Error against processor time, both logarithmic; arrow keys move from point to ' +
        'point. The same numbers are in the table below.',
  });
  private readonly tips = new Tips(this.plot);
  private image: SVGElement|null = null;
  // Lines and floors, in the order of `lines`.
  private groups: SVGElement[] = [];

  constructor(private readonly study: Study, private readonly lines: Line[]) {
    new ResizeObserver(() => this.draw()).observe(this.plot);
  }

  element(count: number): HTMLElement {
    return el(
        'figure', {id: ID, class: 'errors', 'data-count': String(count)}, this.plot, this.legend());
  }

  private legend(): HTMLElement {
    const items = this.lines.map((line, i) => {
      const button =
          el('button', {
            type: 'button',
            class: 'legend-button',
            'aria-pressed': 'true',
            title: line.entry.how,
          },
             swatch(line.series), el('span', {}, line.entry.name));
      button.addEventListener('click', () => {
        line.isShown = !line.isShown;
        button.setAttribute('aria-pressed', String(line.isShown));
        this.draw();
      });
      const stress = (is: boolean) =>
          this.groups.forEach((group, other) => group.classList.toggle('faint', is && other !== i));
      button.addEventListener('pointerenter', () => stress(line.isShown));
      button.addEventListener('pointerleave', () => stress(false));
      return el('li', {}, button);
    });
    return el('ul', {class: 'legend', 'aria-label': 'Entries of the chart'}, ...items);
  }

  private draw() {
    const width = this.plot.clientWidth;
    if (!width) return;
    const plot = this.layOut(width);
    this.groups = this.lines.map((line) => drawLine(line, plot));
    const image =
        svg('svg', {width, height: plot.height, viewBox: `0 0 ${width} ${plot.height}`},
            ...drawAxes(plot), drawPromise(this.lines, plot), drawFront(this.lines, plot),
            drawReference(this.reference(), plot), ...this.groups);
    // The base is on top, since entries without visible differences coincide.
    const base = this.groups[this.lines.findIndex(({entry}) => entry.is_base)];
    if (base) image.append(base);
    if (this.image)
      this.image.replaceWith(image);
    else
      this.plot.prepend(image);
    this.image = image;
    this.tips.set(this.lines.filter(({isShown}) => isShown).flatMap((line) => tipsOf(line, plot)));
  }

  private layOut(width: number): Plot {
    const rem = parseFloat(getComputedStyle(document.documentElement).fontSize);
    const height = Math.max(HEIGHT_REM_MIN * rem, Math.min(HEIGHT_REM_MAX * rem, ASPECT * width));
    const points = this.lines.flatMap((line) => line.points);
    // Over all entries, so that hiding one does not change the scale.
    const xScale = logScale(points.map((point) => point.cpu_seconds), tickTime);
    const yScale = logScale(
        [
          ...points.flatMap(({relative_mse: error,
                              relative_mse_error: spread}) => [error, error + (spread ?? 0)]),
          ...this.lines.map(({entry}) => floorOf(entry)),
          this.reference(),
        ],
        numbers.powerTick);
    const [top, right, bottom, left] =
        ROOM_REM.map((room) => room * rem) as [number, number, number, number];
    return {
      width,
      height,
      rem,
      xScale,
      yScale,
      x: (seconds) => left + xScale.at(seconds) * (width - left - right),
      y: (error) => top + (1 - yScale.at(error)) * (height - top - bottom),
    };
  }

  private reference(): number|null {
    const error = this.study.reference?.relative_mse;
    if (!isKnown(error) || error <= 0) return null;
    const points = this.lines.flatMap((line) => line.points);
    const low = points.reduce((least, point) => Math.min(least, point.relative_mse), Infinity);
    return error * REFERENCE_REACH >= low ? error : null;
  }
}

const tickTime = (seconds: number) => numbers.time(Number(seconds.toPrecision(2)));

function drawAxes(plot: Plot): SVGElement[] {
  const {rem, xScale, yScale} = plot;
  const [left, right] = [ROOM_REM[3] * rem, plot.width - ROOM_REM[1] * rem];
  const [top, bottom] = [ROOM_REM[0] * rem, plot.height - ROOM_REM[2] * rem];
  const parts: SVGElement[] = [];
  for (const {value, words} of xScale.ticks) {
    const x = plot.x(value);
    parts.push(
        svg('line', {class: words ? 'grid' : 'grid fine', x1: x, x2: x, y1: top, y2: bottom}));
    if (words) parts.push(svg('text', {x, y: bottom + 1.2 * rem, 'text-anchor': 'middle'}, words));
  }
  for (const {value, words} of yScale.ticks) {
    const y = plot.y(value);
    parts.push(
        svg('line', {class: words ? 'grid' : 'grid fine', x1: left, x2: right, y1: y, y2: y}));
    if (words)
      parts.push(
          svg('text', {x: left - 0.5 * rem, y: y + 0.28 * rem, 'text-anchor': 'end'}, words));
  }
  const [middleX, middleY] = [(left + right) / 2, (top + bottom) / 2];
  parts.push(
      svg('text',
          {class: 'axis-name', x: middleX, y: plot.height - 0.4 * rem, 'text-anchor': 'middle'},
          'processor time of the whole image'),
      svg('text', {
        class: 'axis-name',
        'text-anchor': 'middle',
        transform: `translate(${0.9 * rem},${middleY}) rotate(-90)`
      },
          'relMSE against the reference'));
  return parts;
}

const pathOf = (places: [number, number][]) =>
    'M' + places.map(([x, y]) => x.toFixed(2) + ',' + y.toFixed(2)).join('L');

// Half the error for twice the time, starting at the first point of the base: the rate of Monte
// Carlo.
function drawPromise(lines: Line[], plot: Plot): SVGElement {
  const base = lines.find(({entry}) => entry.is_base) ?? lines[0];
  const first = base?.points[0];
  const seconds = lines.flatMap(({points}) => points.map((point) => point.cpu_seconds));
  const last = seconds.reduce((a, b) => Math.max(a, b), 0);
  if (!base?.isShown || !first || last <= first.cpu_seconds) return svg('g');
  const lowest = plot.yScale.ticks[0]?.value ?? first.relative_mse;
  const factor = Math.min(last / first.cpu_seconds, Math.max(1, first.relative_mse / lowest));
  return svg('path', {
    class: 'promise',
    d: pathOf([
      [plot.x(first.cpu_seconds), plot.y(first.relative_mse)],
      [plot.x(first.cpu_seconds * factor), plot.y(first.relative_mse / factor)],
    ]),
  });
}

// The smallest error for each time, as a step function that falls only at points. It covers all
// entries: hiding one does not make another the best.
function drawFront(lines: Line[], plot: Plot): SVGElement {
  const front = lines.flatMap(({points}) => points.filter((point) => point.on_pareto_front));
  front.sort((a, b) => a.cpu_seconds - b.cpu_seconds);
  if (!front.length) return svg('g');
  const places = front.flatMap((point, i): [number, number][] => {
    const [x, y] = [plot.x(point.cpu_seconds), plot.y(point.relative_mse)];
    const before = front[i - 1];
    return before ? [[x, plot.y(before.relative_mse)], [x, y]] : [[x, y]];
  });
  return svg('path', {class: 'front', d: pathOf(places)});
}

function drawReference(error: number|null, plot: Plot): SVGElement {
  if (error === null) return svg('g');
  const y = plot.y(error);
  const [left, right] = [ROOM_REM[3] * plot.rem, plot.width - ROOM_REM[1] * plot.rem];
  return svg(
      'g', {class: 'reference'}, svg('line', {x1: left, x2: right, y1: y, y2: y}),
      svg('text', {x: right, y: y - 0.3 * plot.rem, 'text-anchor': 'end'},
          'error of the reference'));
}

function drawLine({entry, series, points, isShown}: Line, plot: Plot): SVGElement {
  const group = svg('g', {class: entry.is_base ? 'line base' : 'line'});
  group.style.setProperty('--series', series.color);
  if (!isShown) return group;
  const floor = floorOf(entry);
  if (isKnown(floor) && floor > 0) {
    const [left, right] = [ROOM_REM[3] * plot.rem, plot.width - ROOM_REM[1] * plot.rem];
    const y = plot.y(floor);
    group.append(svg('line', {class: 'floor', x1: left, x2: right, y1: y, y2: y}));
  }
  const places = points.map(
      (point): [number, number] => [plot.x(point.cpu_seconds), plot.y(point.relative_mse)]);
  if (places.length) group.append(svg('path', {class: 'curve', d: pathOf(places)}));
  points.forEach((point, i) => {
    const [x, y] = places[i] ?? [0, 0];
    const {relative_mse: error, relative_mse_error: spread} = point;
    if (isKnown(spread) && spread > 0) {
      group.append(svg(
          'line',
          {class: 'spread', x1: x, x2: x, y1: plot.y(error + spread), y2: plot.y(error - spread)}));
    }
    group.append(svg('path', {
      class: point.on_pareto_front ? 'point on-front' : 'point',
      d: series.shape((point.on_pareto_front ? 0.38 : 0.28) * plot.rem),
      transform: `translate(${x.toFixed(2)},${y.toFixed(2)})`,
    }));
  });
  return group;
}

const tipsOf = ({entry, points}: Line, plot: Plot): Tip[] => points.map(
    (point) => ({
      x: plot.x(point.cpu_seconds),
      y: plot.y(point.relative_mse),
      lines: [
        entry.name,
        numbers.samples(point.samples) + ' samples per pixel',
        numbers.time(point.cpu_seconds) + ' of processor time',
        'relMSE ' + numbers.measured(point.relative_mse, point.relative_mse_error),
        'typical error of a pixel: ' + numbers.typicalError(point.relative_mse),
        ...(point.on_pareto_front ?
              ['on the front: no other point is both cheaper and better'] :
              []),
      ],
    }));
