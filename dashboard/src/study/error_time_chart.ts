// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Error against CPU time on logarithmic axes, of a few entries at once: a line with error bars for
// each, dashed if it is biased, the front of those that render the same image, and the bias floors.

import {el} from '../dom';

import {ColorSlots, firstShown, SHOWN_MAX} from './curve_choice';
import * as numbers from './numbers';
import {isKnown} from './numbers';
import type {Scale} from './scale';
import {errorScale, timeScale} from './scale';
import type {Entry, Point, Study} from './schema';
import type {Series} from './svg';
import {curveSwatch, seriesAt, svg} from './svg';
import type {Tip} from './tips';
import {Tips} from './tips';

interface PlacedPoint extends Point {
  cpu_seconds: number;
  relative_mse: number;
}

interface Line {
  entry: Entry;
  // By ascending time.
  points: PlacedPoint[];
  // Null if it is not shown.
  series: Series|null;
}

interface Plot {
  width: number;
  height: number;
  rem: number;
  // Width of the margin to the right.
  right: number;
  x: (seconds: number) => number;
  y: (error: number) => number;
  xScale: Scale;
  yScale: Scale;
}

type ShownLine = Line&{series: Series};

const ID = 'chart-error';
const EMPTY = 'No error was measured, so there is nothing to plot against time.';
// Height of the chart over its width, and the limits of the height.
const ASPECT = 0.55;
const HEIGHT_REM_MIN = 20;
const HEIGHT_REM_MAX = 38;
// Margins of the plot: top, right, bottom, left.
const ROOM_REM = [0.8, 1.2, 3.2, 4.2] as const;
// From this width on, names stand beside the ends of curves, in a margin of this width.
const NAMES_FROM_REM = 45;
const NAMES_ROOM_REM = 11;
const NAME_HEIGHT_REM = 1.1;
// Longer names are cut, so that the margin holds them and the word for a bias.
const NAME_LENGTH_MAX = 20;
const BIASED_NAME_LENGTH_MAX = 12;
// The error of the reference is drawn if it is at most this factor below the points.
const REFERENCE_REACH = 30;

const isPlaced = (point: Point): point is PlacedPoint => isKnown(point.cpu_seconds) &&
    isKnown(point.relative_mse) && point.cpu_seconds > 0 && point.relative_mse > 0;

const floorOf = ({bias_floor: floor}: Entry) => floor?.is_significant ? floor.relative_mse : null;

const wordsOf = ({name, is_unbiased}: Entry) => name + (is_unbiased ? '' : ' (biased)');

export function errorTimeChart(study: Study): HTMLElement {
  const lines = study.entries.map(
      (entry): Line => ({
        entry,
        series: null,
        points: entry.points.filter(isPlaced).sort((a, b) => a.cpu_seconds - b.cpu_seconds),
      }));
  if (!lines.some(({points}) => points.length))
    return el('p', {id: ID, class: 'empty', 'data-count': '0'}, EMPTY);
  return new ErrorTimeChart(study, lines).element;
}

class ErrorTimeChart {
  private readonly plot = el('div', {
    class: 'error-plot',
    role: 'group',
    'aria-label': 'Error against processor time, both logarithmic; arrow keys move from point to ' +
        'point. The same numbers are in the table below.',
  });
  private readonly tips = new Tips(this.plot);
  private readonly slots = new ColorSlots();
  private readonly buttons: HTMLElement[] = [];
  private image: SVGElement|null = null;
  // Lines and floors, in the order of `lines`.
  private groups: SVGElement[] = [];
  readonly element: HTMLElement;

  constructor(private readonly study: Study, private readonly lines: Line[]) {
    for (const index of firstShown(study.entries)) this.slots.add(index);
    const items = lines.map((line, i) => el('li', {}, this.button(line, i)));
    const words =
        el('p', {class: 'words'},
           `Curves, ${SHOWN_MAX} at once at most. Dashed curves are biased: ` +
               'they are those of another image.');
    this.element =
        el('figure', {id: ID, class: 'errors'}, this.plot, words,
           el('ul', {class: 'legend', 'aria-label': 'Curves of the chart'}, ...items));
    this.update();
    new ResizeObserver(() => this.draw()).observe(this.plot);
  }

  private button({entry}: Line, index: number): HTMLElement {
    const button = el('button', {type: 'button', class: 'legend-button', title: entry.how});
    button.addEventListener('click', () => {
      if (this.slots.slotOf(index) === undefined)
        this.slots.add(index);
      else
        this.slots.remove(index);
      this.update();
      this.draw();
    });
    const stress = (is: boolean) =>
        this.groups.forEach((group, i) => group.classList.toggle('faint', is && i !== index));
    button.addEventListener('pointerenter', () => stress(this.slots.slotOf(index) !== undefined));
    button.addEventListener('pointerleave', () => stress(false));
    this.buttons.push(button);
    return button;
  }

  // Colors and buttons after a choice.
  private update() {
    this.lines.forEach((line, i) => {
      const slot = this.slots.slotOf(i);
      line.series = slot === undefined ? null : seriesAt(slot);
      const button = this.buttons[i] as HTMLButtonElement;
      button.disabled = !line.points.length || (!line.series && this.slots.isFull());
      button.setAttribute('aria-pressed', String(line.series !== null));
      const mark = line.series ? [curveSwatch(line.series, !line.entry.is_unbiased)] : [];
      button.replaceChildren(...mark, el('span', {}, wordsOf(line.entry)));
    });
    const count = this.shown().reduce((sum, {points}) => sum + points.length, 0);
    this.element.dataset.count = String(count);
  }

  private shown(): ShownLine[] {
    return this.lines.filter((line): line is ShownLine => line.series !== null);
  }

  private draw() {
    const width = this.plot.clientWidth;
    if (!width) return;
    const plot = this.layOut(width);
    const front = frontOf(this.shown());
    this.groups = this.lines.map((line) => drawLine(line, front, plot));
    const image = svg(
        'svg', {width, height: plot.height, viewBox: `0 0 ${width} ${plot.height}`},
        ...drawAxes(plot), drawPromise(this.lines, plot), drawFront(front, plot),
        drawReference(this.reference(), plot), ...this.groups, ...drawNames(this.shown(), plot));
    // The base is on top, since entries without visible differences coincide.
    const base = this.groups[this.lines.findIndex(({entry}) => entry.is_base)];
    if (base) image.append(base);
    if (this.image)
      this.image.replaceWith(image);
    else
      this.plot.prepend(image);
    this.image = image;
    this.tips.set(this.shown().flatMap((line) => tipsOf(line, front, plot)));
  }

  private layOut(width: number): Plot {
    const rem = parseFloat(getComputedStyle(document.documentElement).fontSize);
    const height = Math.max(HEIGHT_REM_MIN * rem, Math.min(HEIGHT_REM_MAX * rem, ASPECT * width));
    const points = this.lines.flatMap((line) => line.points);
    // Over all entries, so that hiding one does not change the scale.
    const xScale = timeScale(points.map((point) => point.cpu_seconds));
    const yScale = errorScale([
      ...points.flatMap(
          ({relative_mse: error, relative_mse_error: spread}) => [error, error + (spread ?? 0)]),
      ...this.lines.map(({entry}) => floorOf(entry)),
      this.reference(),
    ]);
    const [top, margin, bottom, left] =
        ROOM_REM.map((room) => room * rem) as [number, number, number, number];
    const right = width >= NAMES_FROM_REM * rem ? NAMES_ROOM_REM * rem : margin;
    return {
      width,
      height,
      rem,
      right,
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

function drawAxes(plot: Plot): SVGElement[] {
  const {rem, xScale, yScale} = plot;
  const [left, right] = [ROOM_REM[3] * rem, plot.width - plot.right];
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
          'typical error of a pixel'));
  return parts;
}

const pathOf = (places: [number, number][]) =>
    'M' + places.map(([x, y]) => x.toFixed(2) + ',' + y.toFixed(2)).join('L');

// Half the error for four times the time, starting at the first point of the base: the rate of
// Monte Carlo.
function drawPromise(lines: Line[], plot: Plot): SVGElement {
  const base = lines.find(({entry}) => entry.is_base) ?? lines[0];
  const first = base?.points[0];
  const seconds = lines.flatMap(({points}) => points.map((point) => point.cpu_seconds));
  const last = seconds.reduce((a, b) => Math.max(a, b), 0);
  if (!base?.series || !first || last <= first.cpu_seconds) return svg('g');
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

// The points of unbiased lines that no other one beats in both time and error, by ascending time.
function frontOf(lines: ShownLine[]): PlacedPoint[] {
  const points = lines.filter(({entry}) => entry.is_unbiased).flatMap((line) => line.points);
  points.sort((a, b) => a.cpu_seconds - b.cpu_seconds || a.relative_mse - b.relative_mse);
  const front: PlacedPoint[] = [];
  for (const point of points) {
    const last = front.at(-1);
    if (!last || point.relative_mse < last.relative_mse) front.push(point);
  }
  return front;
}

// The smallest error for each time, as a step function that falls only at points.
function drawFront(front: PlacedPoint[], plot: Plot): SVGElement {
  if (!front.length) return svg('g');
  const places = front.flatMap((point, i): [number, number][] => {
    const [x, y] = [plot.x(point.cpu_seconds), plot.y(point.relative_mse)];
    const before = front[i - 1];
    return before ? [[x, plot.y(before.relative_mse)], [x, y]] : [[x, y]];
  });
  return svg('path', {class: 'front', d: pathOf(places)});
}

function shortNameOf(entry: Entry): string {
  const most = entry.is_unbiased ? NAME_LENGTH_MAX : BIASED_NAME_LENGTH_MAX;
  const {name} = entry;
  return wordsOf({...entry, name: name.length > most ? name.slice(0, most - 1) + '…' : name});
}

// Names beside the ends of the curves, moved apart where they would overlap.
function drawNames(lines: ShownLine[], plot: Plot): SVGElement[] {
  const {rem} = plot;
  if (plot.right < NAMES_ROOM_REM * rem) return [];
  const ends = lines.flatMap((line) => {
    const last = line.points.at(-1);
    return last ? [{line, y: plot.y(last.relative_mse)}] : [];
  });
  ends.sort((a, b) => a.y - b.y);
  let lowest = plot.height - ROOM_REM[2] * rem;
  for (const end of [...ends].reverse()) {
    end.y = Math.min(end.y, lowest);
    lowest = end.y - NAME_HEIGHT_REM * rem;
  }
  let least = ROOM_REM[0] * rem;
  return ends.map(({line, y}) => {
    const place = Math.max(y, least);
    least = place + NAME_HEIGHT_REM * rem;
    const name =
        svg('text',
            {class: 'curve-name', x: plot.width - plot.right + 0.7 * rem, y: place + 0.28 * rem},
            shortNameOf(line.entry));
    name.style.fill = line.series.color;
    return name;
  });
}

function drawReference(error: number|null, plot: Plot): SVGElement {
  if (error === null) return svg('g');
  const y = plot.y(error);
  const [left, right] = [ROOM_REM[3] * plot.rem, plot.width - plot.right];
  return svg(
      'g', {class: 'reference'}, svg('line', {x1: left, x2: right, y1: y, y2: y}),
      svg('text', {x: right, y: y - 0.3 * plot.rem, 'text-anchor': 'end'},
          'error of the reference'));
}

function drawLine({entry, series, points}: Line, front: PlacedPoint[], plot: Plot): SVGElement {
  const group = svg('g', {class: entry.is_base ? 'line base' : 'line'});
  if (!series) return group;
  group.style.setProperty('--series', series.color);
  const floor = floorOf(entry);
  if (isKnown(floor) && floor > 0) {
    const [left, right] = [ROOM_REM[3] * plot.rem, plot.width - plot.right];
    const y = plot.y(floor);
    group.append(svg('line', {class: 'floor', x1: left, x2: right, y1: y, y2: y}));
  }
  const places = points.map(
      (point): [number, number] => [plot.x(point.cpu_seconds), plot.y(point.relative_mse)]);
  if (places.length) {
    const name = entry.is_unbiased ? 'curve' : 'curve biased';
    group.append(svg('path', {class: name, d: pathOf(places)}));
  }
  points.forEach((point, i) => {
    const [x, y] = places[i] ?? [0, 0];
    const {relative_mse: error, relative_mse_error: spread} = point;
    if (isKnown(spread) && spread > 0) {
      group.append(svg(
          'line',
          {class: 'spread', x1: x, x2: x, y1: plot.y(error + spread), y2: plot.y(error - spread)}));
    }
    const isOnFront = front.includes(point);
    group.append(svg('path', {
      class: isOnFront ? 'point on-front' : 'point',
      d: series.shape((isOnFront ? 0.38 : 0.28) * plot.rem),
      transform: `translate(${x.toFixed(2)},${y.toFixed(2)})`,
    }));
  });
  return group;
}

const tipsOf = ({entry, points}: Line, front: PlacedPoint[], plot: Plot): Tip[] => points.map(
    (point) => ({
      x: plot.x(point.cpu_seconds),
      y: plot.y(point.relative_mse),
      lines: [
        wordsOf(entry),
        numbers.samples(point.samples) + ' samples per pixel',
        numbers.time(point.cpu_seconds) + ' of processor time',
        'error of a pixel ' + numbers.measuredError(point.relative_mse, point.relative_mse_error),
        'relMSE ' + numbers.measured(point.relative_mse, point.relative_mse_error),
        ...(front.includes(point) ? ['on the front of the curves shown'] : []),
      ],
    }));
