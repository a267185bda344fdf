// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The values of a crate's fields.

import type {CrateBytes} from './crate_bytes';
import {Asset, Reference, UsdError} from './layer';
import type {Dictionary, ListEdit, Numbers, Samples, Value} from './layer';

// The types, by OpenUSD's crateDataTypes.h.
enum Type {
  Bool = 1,
  UChar,
  Int,
  UInt,
  Int64,
  UInt64,
  Half,
  Float,
  Double,
  String,
  Token,
  AssetPath,
  Matrix2d,
  Matrix3d,
  Matrix4d,
  Quatd,
  Quatf,
  Quath,
  Vec2d,
  Vec2f,
  Vec2h,
  Vec2i,
  Vec3d,
  Vec3f,
  Vec3h,
  Vec3i,
  Vec4d,
  Vec4f,
  Vec4h,
  Vec4i,
  Dictionary,
  TokenListOp,
  StringListOp,
  PathListOp,
  ReferenceListOp,
  IntListOp,
  Int64ListOp,
  UIntListOp,
  UInt64ListOp,
  PathVector,
  TokenVector,
  Specifier,
  Permission,
  Variability,
  VariantSelectionMap,
  TimeSamples,
  Payload,
  DoubleVector,
  LayerOffsetVector,
  StringVector,
  ValueBlock,
  Value,
  UnregisteredValue,
  UnregisteredValueListOp,
  PayloadListOp,
  TimeCode,
}

// The kind and the count of the numbers of a type.
type Kind = 'h'|'f'|'d'|'i';
const SHAPES: Partial<Record<Type, [Kind, number]>> = {
  [Type.Half]: ['h', 1],
  [Type.Float]: ['f', 1],
  [Type.Double]: ['d', 1],
  [Type.TimeCode]: ['d', 1],
  [Type.Int]: ['i', 1],
  [Type.Matrix2d]: ['d', 4],
  [Type.Matrix3d]: ['d', 9],
  [Type.Matrix4d]: ['d', 16],
  [Type.Quatd]: ['d', 4],
  [Type.Quatf]: ['f', 4],
  [Type.Quath]: ['h', 4],
  [Type.Vec2d]: ['d', 2],
  [Type.Vec2f]: ['f', 2],
  [Type.Vec2h]: ['h', 2],
  [Type.Vec2i]: ['i', 2],
  [Type.Vec3d]: ['d', 3],
  [Type.Vec3f]: ['f', 3],
  [Type.Vec3h]: ['h', 3],
  [Type.Vec3i]: ['i', 3],
  [Type.Vec4d]: ['d', 4],
  [Type.Vec4f]: ['f', 4],
  [Type.Vec4h]: ['h', 4],
  [Type.Vec4i]: ['i', 4],
};
const BYTES: Record<Kind, number> = {
  h: 2,
  f: 4,
  d: 8,
  i: 4
};
const DEPTH_MAX = 64;

// The value of a list operation: its items are paths, references or strings.
export class Edit {
  constructor(readonly list: ListEdit<string|Reference>) {}
}

export type FieldValue = Value|Edit|Reference|Samples;

export class CrateValues {
  private depth = 0;

  constructor(
      private readonly bytes: CrateBytes, private readonly version: number,
      private readonly tokens: string[], private readonly strings: number[],
      private readonly path: (index: number) => string) {}

  // The value of a representation: type and flags in the high bytes, a payload in the low six.
  read(low: number, high: number): FieldValue {
    const type = (high >>> 16) & 0xFF;
    const isArray = (high >>> 31) === 1;
    const isInlined = ((high >>> 30) & 1) === 1;
    const isCompressed = ((high >>> 29) & 1) === 1;
    const payload = low + (high & 0xFFFF) * 2 ** 32;
    if (type === Type.ValueBlock) return null;
    if (isInlined && !isArray) return this.inlined(type, low);
    if (isArray && payload === 0) return [];
    if (++this.depth > DEPTH_MAX) throw new UsdError(`values are nested deeper than ${DEPTH_MAX}`);
    const back = this.bytes.tell();
    this.bytes.seek(payload);
    const value = isArray ? this.array(type, isCompressed) : this.scalar(type);
    this.bytes.seek(back);
    this.depth--;
    return value;
  }

  private readNext(): FieldValue {
    const low = this.bytes.u32();
    return this.read(low, this.bytes.u32());
  }

  private token(index: number): string {
    const token = this.tokens[index];
    if (token === undefined) throw new RangeError();
    return token;
  }

  private string(index: number): string {
    return this.token(this.strings[index] ?? -1);
  }

  private inlined(type: Type, low: number): Value {
    const view = new DataView(new ArrayBuffer(4));
    view.setUint32(0, low, true);
    switch (type) {
      case Type.Bool:
        return low !== 0;
      case Type.Int:
        return view.getInt32(0, true);
      case Type.Int64:
        return view.getInt32(0, true);
      case Type.Half:
        return half(low & 0xFFFF);
      case Type.Float:
      case Type.Double:
      case Type.TimeCode:
        return view.getFloat32(0, true);
      case Type.Token:
      case Type.AssetPath: {
        const text = this.token(low);
        return type === Type.AssetPath ? new Asset(text) : text;
      }
      case Type.String:
        return this.string(low);
      case Type.Vec2h:
        return [half(low & 0xFFFF), half(low >>> 16)];
      case Type.Dictionary:
      case Type.VariantSelectionMap:
        return {};
      default:
        break;
    }
    const shape = SHAPES[type];
    // Tuples of small whole numbers are inlined by a byte each; matrices by their diagonals.
    if (shape && type >= Type.Vec2d) {
      return Array.from({length: shape[1]}, (_, i) => view.getInt8(i));
    }
    if (shape && shape[1] > 1) {
      const size = Math.sqrt(shape[1]);
      return Array.from(
          {length: shape[1]}, (_, i) => i % (size + 1) === 0 ? view.getInt8(i / (size + 1)) : 0);
    }
    return low;
  }

  private numbers(kind: Kind, count: number): Numbers {
    const {bytes} = this;
    const raw = bytes.raw(count * BYTES[kind]);
    const copy = raw.slice().buffer;
    if (kind === 'f') return new Float32Array(copy);
    if (kind === 'd') return new Float64Array(copy);
    if (kind === 'i') return new Int32Array(copy);
    return Float32Array.from(new Uint16Array(copy), half);
  }

  private scalar(type: Type): FieldValue {
    const {bytes} = this;
    const shape = SHAPES[type];
    if (shape) {
      const numbers = Array.from(this.numbers(shape[0], shape[1]));
      return shape[1] === 1 ? numbers[0]! : numbers;
    }
    switch (type) {
      case Type.Int64:
        return bytes.i64();
      case Type.UInt64:
        return bytes.u64();
      case Type.UInt:
        return bytes.u32();
      case Type.Token:
        return this.token(bytes.u32());
      case Type.String:
        return this.string(bytes.u32());
      case Type.AssetPath:
        return new Asset(this.token(bytes.u32()));
      case Type.TokenVector:
        return this.list(() => this.token(bytes.u32()));
      case Type.StringVector:
        return this.list(() => this.string(bytes.u32()));
      case Type.PathVector:
        return this.list(() => this.path(bytes.u32()));
      case Type.DoubleVector:
        return this.numbers('d', bytes.count(8));
      case Type.Dictionary:
        return this.dictionary();
      case Type.VariantSelectionMap:
        return this.selections();
      case Type.TimeSamples:
        return this.samples();
      case Type.PathListOp:
        return this.edit(() => this.path(bytes.u32()));
      case Type.TokenListOp:
        return this.edit(() => this.token(bytes.u32()));
      case Type.StringListOp:
        return this.edit(() => this.string(bytes.u32()));
      case Type.ReferenceListOp:
        return this.edit(() => this.reference(true));
      case Type.PayloadListOp:
        return this.edit(() => this.reference(false));
      case Type.Payload:
        return this.reference(false);
      case Type.Value:
        return this.readNext();
      default:
        return null;
    }
  }

  private list<T>(item: () => T): T[] {
    return Array.from({length: this.bytes.count(4)}, item);
  }

  private edit(item: () => string | Reference): Edit {
    const flags = this.bytes.u8();
    const list: ListEdit<string|Reference> = {};
    if (flags & 1) list.explicit = [];
    if (flags & 2) list.explicit = this.list(item);
    const added = flags & 4 ? this.list(item) : [];
    if (flags & 32) list.before = this.list(item);
    const appended = flags & 64 ? this.list(item) : [];
    if (added.length + appended.length > 0) list.after = [...added, ...appended];
    if (flags & 8) list.deleted = this.list(item);
    return new Edit(list);
  }

  private reference(hasData: boolean): Reference {
    const {bytes} = this;
    const asset = this.string(bytes.u32());
    const prim = bytes.u32();
    if (hasData || this.version >= 8) {
      bytes.f64();
      bytes.f64();
    }
    if (hasData) this.dictionary();
    const path = this.path(prim);
    return new Reference(asset, path === '/' ? '' : path);
  }

  private dictionary(): Dictionary {
    const {bytes} = this;
    const result: Dictionary = {};
    for (let count = bytes.count(12); count > 0; count--) {
      const key = this.string(bytes.u32());
      const begin = bytes.tell();
      bytes.seek(begin + bytes.i64());
      if (++this.depth > DEPTH_MAX) throw new UsdError('dictionaries are nested too deep');
      result[key] = this.readNext() as Value;
      this.depth--;
      bytes.seek(begin + 8);
    }
    return result;
  }

  private selections(): Dictionary {
    const result: Dictionary = {};
    for (let count = this.bytes.count(8); count > 0; count--) {
      const key = this.string(this.bytes.u32());
      result[key] = this.string(this.bytes.u32());
    }
    return result;
  }

  private samples(): Samples {
    const {bytes} = this;
    let begin = bytes.tell();
    bytes.seek(begin + bytes.i64());
    const times = Array.from(this.readNext() as Numbers);
    begin = bytes.tell();
    bytes.seek(begin + bytes.i64());
    const count = bytes.count(8);
    const values: Value[] = [];
    for (let i = 0; i < count; i++) values.push(this.readNext() as Value);
    return {times: times.slice(0, values.length), values};
  }

  private array(type: Type, isCompressed: boolean): Value {
    const {bytes} = this;
    if (this.version < 5) bytes.u32();  // The number of dimensions, which is 1.
    const count = this.version < 7 ? bytes.u32() : bytes.u64();
    const shape = SHAPES[type];
    if (isCompressed) return this.compressedArray(type, count);
    if (shape) return this.numbers(shape[0], count * shape[1]);
    const text = (at: () => string) => {
      if (count * 4 > 2 ** 31) throw new RangeError();
      return Array.from({length: count}, at);
    };
    switch (type) {
      case Type.UInt:
        return new Uint32Array(bytes.raw(count * 4).slice().buffer);
      case Type.Bool:
      case Type.UChar:
        return Int32Array.from(bytes.raw(count));
      case Type.Int64:
      case Type.UInt64:
        return Float64Array.from(new BigInt64Array(bytes.raw(count * 8).slice().buffer), Number);
      case Type.Token:
      case Type.AssetPath:
        return text(() => this.token(bytes.u32()));
      case Type.String:
        return text(() => this.string(bytes.u32()));
      default:
        return [];
    }
  }

  private compressedArray(type: Type, count: number): Value {
    const {bytes} = this;
    // Short arrays are not compressed, though the flag says so.
    if (type === Type.Int || type === Type.UInt) {
      if (count < 16) return this.numbers('i', count);
      return bytes.integers(count);
    }
    if (type === Type.Int64 || type === Type.UInt64) return bytes.longIntegers(count);
    const shape = SHAPES[type];
    if (!shape || shape[1] !== 1) throw new UsdError(`it has a compressed array of type ${type}`);
    if (count < 16) return this.numbers(shape[0], count);
    const code = String.fromCharCode(bytes.u8());
    if (code === 'i') return Float64Array.from(bytes.integers(count));
    const table = this.numbers(shape[0], bytes.u32());
    return Float64Array.from(bytes.integers(count), i => table[i] ?? 0);
  }
}

// A number of 16 bits.
function half(bits: number): number {
  const sign = bits & 0x8000 ? -1 : 1;
  const exponent = (bits >> 10) & 31;
  const fraction = bits & 1023;
  if (exponent === 0) return sign * fraction * 2 ** -24;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
}
