// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The bytes of a crate: its header, sections, and compressed blocks and integers.

import {UsdError} from './layer';

const EXPANSION_MAX = 256;
const INTEGERS_A_BYTE_MAX = 1024;
const CHUNK_BYTES = 0x7E000000;
const BYTES_MAX = 2 ** 31 - 1;

export class CrateBytes {
  private readonly view: DataView;
  private at = 0;

  constructor(private readonly bytes: Uint8Array) {
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  }

  seek(at: number) {
    if (!(at >= 0 && at <= this.bytes.length)) throw new RangeError();
    this.at = at;
  }

  tell(): number {
    return this.at;
  }

  private next(bytes: number): number {
    const at = this.at;
    if (!(bytes >= 0) || at + bytes > this.bytes.length) throw new RangeError();
    this.at = at + bytes;
    return at;
  }

  u8(): number {
    return this.view.getUint8(this.next(1));
  }
  i8(): number {
    return this.view.getInt8(this.next(1));
  }
  u16(): number {
    return this.view.getUint16(this.next(2), true);
  }
  i32(): number {
    return this.view.getInt32(this.next(4), true);
  }
  u32(): number {
    return this.view.getUint32(this.next(4), true);
  }
  f32(): number {
    return this.view.getFloat32(this.next(4), true);
  }
  f64(): number {
    return this.view.getFloat64(this.next(8), true);
  }
  u64(): number {
    return Number(this.view.getBigUint64(this.next(8), true));
  }
  i64(): number {
    return Number(this.view.getBigInt64(this.next(8), true));
  }

  raw(bytes: number): Uint8Array {
    const at = this.next(bytes);
    return this.bytes.subarray(at, at + bytes);
  }

  // A count of things that have at least `bytes` each in the rest of the file.
  count(bytes: number): number {
    const count = this.u64();
    if (count * Math.max(bytes, 1 / EXPANSION_MAX) > this.bytes.length) throw new RangeError();
    return count;
  }

  // The version, as 100 times the major and the minor one.
  header(): number {
    this.seek(8);
    const [major, minor] = this.raw(8);
    const version = major! * 100 + minor!;
    if (version < 4 || version > 13) {
      throw new UsdError(`it is a crate of version ${major}.${minor}; 0.4 to 0.13 are read`);
    }
    return version;
  }

  sections(): {name: string; start: number; size: number}[] {
    this.seek(16);
    this.seek(this.u64());
    return Array.from({length: this.count(32)}, () => {
      const name = new TextDecoder().decode(this.raw(16)).replace(/\0.*$/s, '');
      return {name, start: this.u64(), size: this.u64()};
    });
  }

  tokens(): string[] {
    const count = this.count(0);
    const size = this.u64();
    const text = this.compressed(size);
    const result: string[] = [];
    const decoder = new TextDecoder();
    for (let begin = 0; result.length < count;) {
      const end = text.indexOf(0, begin);
      if (end < 0) throw new RangeError();
      result.push(decoder.decode(text.subarray(begin, end)));
      begin = end + 1;
    }
    return result;
  }

  // A block: its compressed size, then chunks of LZ4.
  compressed(size: number): Uint8Array {
    const packed = this.raw(this.u64());
    if (!(size <= BYTES_MAX)) throw new RangeError();
    // Integers say how many bytes they have at most. LZ4 makes no more than 255 of one.
    const result = new Uint8Array(Math.min(size, packed.length * EXPANSION_MAX + 64));
    const chunks = packed[0] ?? 0;
    let used = 0;
    if (chunks === 0) {
      used = lz4(packed.subarray(1), result);
    } else {
      const view = new DataView(packed.buffer, packed.byteOffset, packed.byteLength);
      let at = 1;
      for (let i = 0; i < chunks; i++) {
        const bytes = view.getUint32(at, true);
        at += 4;
        used += lz4(packed.subarray(at, at + bytes), result.subarray(used, used + CHUNK_BYTES));
        at += bytes;
      }
    }
    return result.subarray(0, used);
  }

  // Integers of 32 bits, as differences of 0, 8, 16 or 32 bits.
  integers(count: number): Int32Array {
    const result = new Int32Array(this.checked(count));
    if (count === 0) return result;
    const codeBytes = (count * 2 + 7) >> 3;
    const data = this.compressed(4 + codeBytes + count * 4);
    const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
    const common = view.getInt32(0, true);
    let at = 4 + codeBytes;
    let last = 0;
    for (let i = 0; i < count; i++) {
      const code = (view.getUint8(4 + (i >> 2)) >> ((i & 3) * 2)) & 3;
      if (code === 0)
        last += common;
      else if (code === 1)
        last += view.getInt8(at++);
      else if (code === 2)
        last += view.getInt16((at += 2) - 2, true);
      else
        last += view.getInt32((at += 4) - 4, true);
      last |= 0;
      result[i] = last;
    }
    return result;
  }

  // Integers of 64 bits, as differences of 0, 16, 32 or 64 bits.
  longIntegers(count: number): Float64Array {
    const result = new Float64Array(this.checked(count));
    if (count === 0) return result;
    const codeBytes = (count * 2 + 7) >> 3;
    const data = this.compressed(8 + codeBytes + count * 8);
    const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
    const common = view.getBigInt64(0, true);
    let at = 8 + codeBytes;
    let last = 0n;
    for (let i = 0; i < count; i++) {
      const code = (view.getUint8(8 + (i >> 2)) >> ((i & 3) * 2)) & 3;
      if (code === 0)
        last += common;
      else if (code === 1)
        last += BigInt(view.getInt16((at += 2) - 2, true));
      else if (code === 2)
        last += BigInt(view.getInt32((at += 4) - 4, true));
      else
        last += view.getBigInt64((at += 8) - 8, true);
      result[i] = Number(last);
    }
    return result;
  }

  private checked(count: number): number {
    if (!(count <= BYTES_MAX / 8) || count > this.bytes.length * INTEGERS_A_BYTE_MAX) {
      throw new RangeError();
    }
    return count;
  }
}

// Unpacks one LZ4 block; the number of bytes.
function lz4(from: Uint8Array, to: Uint8Array): number {
  let at = 0;
  let out = 0;
  const length = (nibble: number) => {
    let result = nibble;
    if (nibble === 15) {
      let byte: number;
      do {
        if (at >= from.length) throw new RangeError();
        byte = from[at++]!;
        result += byte;
      } while (byte === 255);
    }
    return result;
  };
  while (at < from.length) {
    const token = from[at++]!;
    const literals = length(token >> 4);
    if (at + literals > from.length || out + literals > to.length) throw new RangeError();
    to.set(from.subarray(at, at + literals), out);
    at += literals;
    out += literals;
    if (at >= from.length) break;
    const offset = from[at]! | (from[at + 1] ?? 0) << 8;
    at += 2;
    const matched = length(token & 15) + 4;
    if (offset === 0 || offset > out || out + matched > to.length) throw new RangeError();
    for (let i = 0; i < matched; i++, out++) to[out] = to[out - offset]!;
  }
  return out;
}
