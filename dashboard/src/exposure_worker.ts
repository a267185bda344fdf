// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Exposes images on a separate thread, so that the page never blocks on millions of pixels. The
// layer "light" is twice as high as its image: levels in the upper half, and in the lower half the
// exponents that they share (see the coordinator's image_layer.h).

export interface ExposureRequest {
  key: string;
  // Null means the one sent last.
  light: ImageBitmap|null;
  stops: number;
}

export interface ExposureReply {
  key: string;
  // Null on failure.
  image: ImageBitmap|null;
  failure: string;
}

// Steps of linear light from 0 to 1 in the table of the display's curve: finer than the display's
// levels even where the curve is steepest.
const TABLE_STEPS = 1 << 16;
const EXPONENT_BIAS = 136;

interface Light {
  width: number;
  height: number;
  // Row-major [height][width][3], linear.
  values: Float32Array;
}

const levelOfLight = makeTable();
let light: Light|null = null;

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

function decode(bitmap: ImageBitmap): Light {
  const {width} = bitmap;
  const height = bitmap.height / 2;
  const context = new OffscreenCanvas(width, bitmap.height).getContext('2d');
  if (!context) throw new Error('this browser does not support an offscreen 2D canvas');
  context.drawImage(bitmap, 0, 0);
  bitmap.close();
  const bytes = context.getImageData(0, 0, width, 2 * height).data;
  const units = Float32Array.from({length: 256}, (_, e) => e ? 2 ** (e - EXPONENT_BIAS) : 0);
  const count = width * height;
  const values = new Float32Array(3 * count);
  for (let i = 0; i < count; ++i) {
    const unit = units[bytes[4 * (count + i)]!]!;
    values[3 * i] = bytes[4 * i]! * unit;
    values[3 * i + 1] = bytes[4 * i + 1]! * unit;
    values[3 * i + 2] = bytes[4 * i + 2]! * unit;
  }
  return {width, height, values};
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

async function answer({key, light: next, stops}: ExposureRequest): Promise<ExposureReply> {
  try {
    if (next) light = decode(next);
    if (!light) throw new Error('no image was sent for exposure');
    return {key, image: await expose(light, stops), failure: ''};
  } catch (failure) {
    return {key, image: null, failure: `${failure}`};
  }
}

addEventListener('message', async (event: MessageEvent<ExposureRequest>) => {
  const reply = await answer(event.data);
  postMessage(reply, {transfer: reply.image ? [reply.image] : []});
});
