// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Pixels of PNG and JPEG images, and PNG images of pixels: for textures whose channels glTF wants
// in one image.

import {unzlibSync, zlibSync} from 'fflate';
import {decode as decodeJpeg} from 'jpeg-js';

const PIXELS_MAX = 64 << 20;

// Red, green, blue and alpha of 8 bits.
export interface Pixels {
  width: number;
  height: number;
  data: Uint8Array;
}

export const srgbToLinear = (v: number) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;

export type ImageKind = 'image/png'|'image/jpeg'|'image/webp';

// By the first bytes; undefined: glTF has no such images.
export function imageKind(bytes: Uint8Array): ImageKind|undefined {
  const begin = String.fromCharCode(...bytes.subarray(0, 12));
  if (begin.startsWith('\x89PNG')) return 'image/png';
  if (begin.startsWith('\xFF\xD8\xFF')) return 'image/jpeg';
  if (begin.startsWith('RIFF') && begin.endsWith('WEBP')) return 'image/webp';
  return undefined;
}

// Undefined: not PNG or JPEG, interlaced, broken or too large.
export function decodeImage(bytes: Uint8Array): Pixels|undefined {
  try {
    const kind = imageKind(bytes);
    if (kind === 'image/png') return decodePng(bytes);
    if (kind !== 'image/jpeg') return undefined;
    const image = decodeJpeg(
        bytes, {useTArray: true, maxResolutionInMP: PIXELS_MAX / 1e6, maxMemoryUsageInMB: 1024});
    return {width: image.width, height: image.height, data: image.data};
  } catch {
    return undefined;
  }
}

interface Header {
  width: number;
  height: number;
  depth: number;
  type: number;
}

function decodePng(bytes: Uint8Array): Pixels|undefined {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const parts: Uint8Array[] = [];
  let palette = new Uint8Array();
  let clear = new Uint8Array();
  let header: Header|undefined;
  for (let at = 8; at + 12 <= bytes.length;) {
    const size = view.getUint32(at);
    const name = String.fromCharCode(...bytes.subarray(at + 4, at + 8));
    const data = bytes.slice(at + 8, at + 8 + size);
    if (name === 'IHDR') {
      header = {
        width: view.getUint32(at + 8),
        height: view.getUint32(at + 12),
        depth: data[8]!,
        type: data[9]!
      };
      if (data[12] !== 0 || header.width * header.height > PIXELS_MAX) return undefined;
    }
    if (name === 'PLTE') palette = data;
    if (name === 'tRNS') clear = data;
    if (name === 'IDAT') parts.push(data);
    at += 12 + size;
  }
  if (!header) return undefined;
  const packed = new Uint8Array(parts.reduce((sum, p) => sum + p.length, 0));
  parts.reduce((at, p) => (packed.set(p, at), at + p.length), 0);
  return colorsOf(header, unfiltered(header, unzlibSync(packed)), palette, clear);
}

const channelsOf = (type: number) => [1, 0, 3, 1, 2, 0, 4][type] ?? 0;

function unfiltered(header: Header, raw: Uint8Array): Uint8Array {
  const bits = header.depth * channelsOf(header.type);
  const row = Math.ceil(header.width * bits / 8);
  const step = Math.max(1, bits >> 3);
  const out = new Uint8Array(row * header.height);
  for (let y = 0; y < header.height; y++) {
    const filter = raw[y * (row + 1)]!;
    for (let x = 0; x < row; x++) {
      const a = x >= step ? out[y * row + x - step]! : 0;
      const b = y > 0 ? out[(y - 1) * row + x]! : 0;
      const c = x >= step && y > 0 ? out[(y - 1) * row + x - step]! : 0;
      let guess = 0;
      if (filter === 1)
        guess = a;
      else if (filter === 2)
        guess = b;
      else if (filter === 3)
        guess = (a + b) >> 1;
      else if (filter === 4) {
        const [pa, pb, pc] = [Math.abs(b - c), Math.abs(a - c), Math.abs(a + b - 2 * c)];
        guess = pa <= pb && pa <= pc ? a : pb <= pc ? b : c;
      }
      out[y * row + x] = raw[y * (row + 1) + 1 + x]! + guess;
    }
  }
  return out;
}

function colorsOf(header: Header, out: Uint8Array, palette: Uint8Array, clear: Uint8Array): Pixels {
  const {width, height, depth, type} = header;
  const channels = channelsOf(type);
  const row = Math.ceil(width * depth * channels / 8);
  const data = new Uint8Array(width * height * 4);
  const sample = (y: number, i: number) => {
    if (depth >= 8) return out[y * row + i * (depth >> 3)]!;
    const bit = i * depth;
    const value = (out[y * row + (bit >> 3)]! >> (8 - depth - (bit & 7))) & ((1 << depth) - 1);
    return type === 3 ? value : value * 255 / ((1 << depth) - 1);
  };
  for (let y = 0, at = 0; y < height; y++) {
    for (let x = 0; x < width; x++, at += 4) {
      const s = (k: number) => sample(y, x * channels + k);
      if (type === 3) {
        const i = s(0);
        data.set([palette[i * 3]!, palette[i * 3 + 1]!, palette[i * 3 + 2]!, clear[i] ?? 255], at);
      } else if (channels < 3) {
        data.set([s(0), s(0), s(0), channels === 2 ? s(1) : 255], at);
      } else {
        data.set([s(0), s(1), s(2), channels === 4 ? s(3) : 255], at);
      }
    }
  }
  return {width, height, data};
}

const CRC = Uint32Array.from({length: 256}, (_, n) => {
  let c = n;
  for (let k = 0; k < 8; k++) c = c & 1 ? 0xEDB88320 ^ (c >>> 1) : c >>> 1;
  return c;
});

function chunk(name: string, data: Uint8Array): Uint8Array {
  const result = new Uint8Array(12 + data.length);
  const view = new DataView(result.buffer);
  view.setUint32(0, data.length);
  result.set(new TextEncoder().encode(name), 4);
  result.set(data, 8);
  let crc = 0xFFFFFFFF;
  for (let i = 4; i < 8 + data.length; i++) crc = CRC[(crc ^ result[i]!) & 255]! ^ (crc >>> 8);
  view.setUint32(8 + data.length, ~crc >>> 0);
  return result;
}

export function encodePng({width, height, data}: Pixels): Uint8Array {
  const header = new Uint8Array(13);
  const view = new DataView(header.buffer);
  view.setUint32(0, width);
  view.setUint32(4, height);
  header.set([8, 6], 8);
  const rows = new Uint8Array((width * 4 + 1) * height);
  for (let y = 0; y < height; y++) {
    rows.set(data.subarray(y * width * 4, (y + 1) * width * 4), y * (width * 4 + 1) + 1);
  }
  const parts = [
    Uint8Array.of(137, 80, 78, 71, 13, 10, 26, 10), chunk('IHDR', header),
    chunk('IDAT', zlibSync(rows, {level: 1})), chunk('IEND', new Uint8Array())
  ];
  const result = new Uint8Array(parts.reduce((sum, p) => sum + p.length, 0));
  parts.reduce((at, p) => (result.set(p, at), at + p.length), 0);
  return result;
}
