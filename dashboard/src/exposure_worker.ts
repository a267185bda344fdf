// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Exposes images, shows their luminance in false color, and counts their values on a separate
// thread, so that the page never blocks on millions of pixels. The layer "light" is twice as high
// as its image: levels in the upper half, and in the lower half the exponents that they share (see
// the coordinator's image_layer.h).

import {falseColorPath} from './api';
import type {LayerRange} from './api';
import {LOG_BINS, LOG_HIGH, LOG_LOW} from './light_bins';
import type {Histogram} from './light_bins';

export interface ExposureRequest {
  key: string;
  // Null means the one sent last.
  light: ImageBitmap|null;
  // An image in false color, of which only the histogram is wanted.
  palette: ImageBitmap|null;
  stops: number;
  falseColor: LayerRange|'auto'|null;
  // Whether the histogram is wanted.
  count: boolean;
}

export interface ExposureReply {
  key: string;
  // Null on failure, and for a palette.
  image: ImageBitmap|null;
  // The values at the ends of the false colors, if there are any.
  range: LayerRange|null;
  histogram: Histogram|null;
  failure: string;
}

// Steps of linear light from 0 to 1 in the table of the display's curve: finer than the display's
// levels even where the curve is steepest.
const TABLE_STEPS = 1 << 16;
const EXPONENT_BIAS = 136;
const COLORS = 256;
// Levels between a color of an image and the nearest one of the scale.
const DISTANCE_MAX = 8;
// As common/film/display/exposure.h has them.
const MIDDLE_GRAY = 0.18;
const SATURATED_FRACTION = 0.05;
// The automatic range of false colors leaves out this fraction of the pixels at each end.
const LEFT_OUT_FRACTION = 0.01;
// Bins for quantiles of luminance: 64 a stop, from 2^FINE_LOW to 2^FINE_HIGH.
const FINE_LOW = -32;
const FINE_HIGH = 32;
const FINE_BINS = 64;
// Luminance of linear sRGB, IEC 61966-2-1.
const [LUMINANCE_R, LUMINANCE_G, LUMINANCE_B] = [0.2126, 0.7152, 0.0722];

interface Light {
  width: number;
  height: number;
  // Row-major [height][width][3], linear.
  values: Float32Array;
  // Counted when it is first needed.
  counted: Counted|null;
}

interface Counted {
  histogram: Histogram;
  // Most luminances are in it.
  automaticRange: LayerRange;
}

const levelOfLight = makeTable();
let light: Light|null = null;
// [COLORS][4], from low to high; loaded when it is first needed.
let palette: Promise<Uint8ClampedArray>|null = null;

// The sRGB curve, IEC 61966-2-1.
function makeTable(): Uint8Array {
  const table = new Uint8Array(TABLE_STEPS + 1);
  for (let i = 0; i <= TABLE_STEPS; ++i) {
    const linear = i / TABLE_STEPS;
    const encoded = linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055;
    table[i] = Math.round(encoded * 255);
  }
  return table;
}

function bytesOf(bitmap: ImageBitmap): Uint8ClampedArray {
  const {width, height} = bitmap;
  const context = new OffscreenCanvas(width, height).getContext('2d');
  if (!context) throw new Error('this browser does not support an offscreen 2D canvas');
  context.drawImage(bitmap, 0, 0);
  bitmap.close();
  return context.getImageData(0, 0, width, height).data;
}

function colors(): Promise<Uint8ClampedArray> {
  palette ??= fetch(falseColorPath)
                  .then((response) => response.blob())
                  .then((blob) => createImageBitmap(blob, {colorSpaceConversion: 'none'}))
                  .then(bytesOf);
  return palette;
}

function decode(bitmap: ImageBitmap): Light {
  const {width} = bitmap;
  const height = bitmap.height / 2;
  const bytes = bytesOf(bitmap);
  const units = Float32Array.from({length: 256}, (_, e) => e ? 2 ** (e - EXPONENT_BIAS) : 0);
  const count = width * height;
  const values = new Float32Array(3 * count);
  for (let i = 0; i < count; ++i) {
    const unit = units[bytes[4 * (count + i)]!]!;
    values[3 * i] = bytes[4 * i]! * unit;
    values[3 * i + 1] = bytes[4 * i + 1]! * unit;
    values[3 * i + 2] = bytes[4 * i + 2]! * unit;
  }
  return {width, height, values, counted: null};
}

// Values beyond the ends are counted in the last bins, and black not at all.
function countLight(values: Float32Array): Counted {
  const bins = (LOG_HIGH - LOG_LOW) * LOG_BINS;
  const binOf = (log: number) =>
      Math.max(0, Math.min(bins - 1, Math.floor((log - LOG_LOW) * LOG_BINS)));
  const counts = [0, 1, 2].map(() => new Uint32Array(bins));
  const fine = new Uint32Array((FINE_HIGH - FINE_LOW) * FINE_BINS);
  let known = 0, logSum = 0;
  for (let i = 0; i < values.length; i += 3) {
    const [r, g, b] = [values[i]!, values[i + 1]!, values[i + 2]!];
    if (r > 0) ++counts[0]![binOf(Math.log2(r))]!;
    if (g > 0) ++counts[1]![binOf(Math.log2(g))]!;
    if (b > 0) ++counts[2]![binOf(Math.log2(b))]!;
    const luminance = LUMINANCE_R * r + LUMINANCE_G * g + LUMINANCE_B * b;
    if (!(luminance > 0)) continue;
    const log = Math.log2(luminance);
    const bin = Math.floor((log - FINE_LOW) * FINE_BINS);
    ++fine[Math.max(0, Math.min(fine.length - 1, bin))]!;
    logSum += log;
    ++known;
  }
  const at = (share: number) => logAt(fine, share * known);
  const stops = known === 0 ?
      0 :
      Math.min(Math.log2(MIDDLE_GRAY) - logSum / known, -at(1 - SATURATED_FRACTION));
  const round = (log: number) => Number((2 ** log).toPrecision(2));
  const low = round(at(LEFT_OUT_FRACTION)), high = round(at(1 - LEFT_OUT_FRACTION));
  return {
    histogram: {counts, isLight: true, automaticStops: stops},
    automaticRange: {low, high: high > low ? high : 2 * low},
  };
}

// The logarithm below which `rank` of the counted pixels lie.
function logAt(fine: Uint32Array, rank: number): number {
  let below = 0, bin = 0;
  while (bin < fine.length - 1 && below + fine[bin]! <= rank) below += fine[bin++]!;
  return FINE_LOW + (bin + 0.5) / FINE_BINS;
}

function expose({width, height, values}: Light, stops: number): Promise<ImageBitmap> {
  const gain = 2 ** stops * TABLE_STEPS;
  const bytes = new Uint8ClampedArray(4 * width * height);
  const level = (value: number) => levelOfLight[Math.min(TABLE_STEPS, Math.round(value * gain))]!;
  for (let i = 0, from = 0, to = 0; i < width * height; ++i, from += 3, to += 4) {
    bytes[to] = level(values[from]!);
    bytes[to + 1] = level(values[from + 1]!);
    bytes[to + 2] = level(values[from + 2]!);
    bytes[to + 3] = 255;
  }
  return createImageBitmap(new ImageData(bytes, width, height));
}

// On a logarithmic scale, as the coordinator's false colors of errors.
async function showFalse({width, height, values}: Light, {low, high}: LayerRange) {
  const table = await colors();
  const bytes = new Uint8ClampedArray(4 * width * height);
  const begin = Math.log(low > 0 ? low : high * 1e-6);
  const factor = (COLORS - 1) / (Math.log(high) - begin);
  for (let i = 0, from = 0; i < bytes.length; i += 4, from += 3) {
    const luminance = LUMINANCE_R * values[from]! + LUMINANCE_G * values[from + 1]! +
        LUMINANCE_B * values[from + 2]!;
    const place = luminance > 0 ? Math.round((Math.log(luminance) - begin) * factor) : 0;
    const color = 4 * Math.max(0, Math.min(COLORS - 1, place));
    bytes[i] = table[color]!;
    bytes[i + 1] = table[color + 1]!;
    bytes[i + 2] = table[color + 2]!;
    bytes[i + 3] = 255;
  }
  return createImageBitmap(new ImageData(bytes, width, height));
}

// The place of a color between low and high: that of the nearest color of the scale, which has
// fewer colors than images. Null for the gray of unknown values, which is far from all of them.
function placeOf(color: number, table: Uint8ClampedArray): number|null {
  const [r, g, b] = [color >> 16, color >> 8 & 255, color & 255];
  let best: number|null = null;
  let least = DISTANCE_MAX ** 2;
  for (let i = 0; i < COLORS; ++i) {
    const distance =
        (table[4 * i]! - r) ** 2 + (table[4 * i + 1]! - g) ** 2 + (table[4 * i + 2]! - b) ** 2;
    if (distance > least) continue;
    least = distance;
    best = i;
  }
  return best;
}

async function countPalette(bitmap: ImageBitmap): Promise<Histogram> {
  const table = await colors();
  const places = new Map<number, number|null>();
  const counts = new Uint32Array(COLORS);
  const bytes = bytesOf(bitmap);
  for (let i = 0; i < bytes.length; i += 4) {
    const color = bytes[i]! << 16 | bytes[i + 1]! << 8 | bytes[i + 2]!;
    let place = places.get(color);
    if (place === undefined) places.set(color, place = placeOf(color, table));
    if (place !== null) ++counts[place]!;
  }
  return {counts: [counts], isLight: false, automaticStops: 0};
}

async function answer(request: ExposureRequest): Promise<ExposureReply> {
  const {key, stops, falseColor} = request;
  const empty = {key, image: null, range: null, histogram: null, failure: ''};
  try {
    if (request.palette) return {...empty, histogram: await countPalette(request.palette)};
    if (request.light) light = decode(request.light);
    if (!light) throw new Error('no image was sent for exposure');
    if (request.count || falseColor === 'auto') light.counted ??= countLight(light.values);
    const histogram = light.counted?.histogram ?? null;
    if (!falseColor) return {...empty, image: await expose(light, stops), histogram};
    const automatic = light.counted?.automaticRange ?? {low: 0, high: 1};
    const range = falseColor === 'auto' ? automatic : falseColor;
    return {...empty, image: await showFalse(light, range), range, histogram};
  } catch (failure) {
    return {...empty, failure: `${failure}`};
  }
}

addEventListener('message', async (event: MessageEvent<ExposureRequest>) => {
  const reply = await answer(event.data);
  postMessage(reply, {transfer: reply.image ? [reply.image] : []});
});
