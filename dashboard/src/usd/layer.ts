// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A layer is the content of one file of USD, before composition. The readers of text and of crates
// make layers.

// Numbers of an array, tuples one after another: 3 points are 9 numbers.
export type Numbers = number[]|Int32Array|Uint32Array|Float32Array|Float64Array;

// A value. Tuples, matrices and quaternions (x, y, z, w) are arrays of numbers, as are arrays of
// them. `null` is USD's None: there is no value, whatever weaker layers say.
export type Value = null|boolean|number|string|Numbers|string[]|Asset|Dictionary|Reference[];

export interface Dictionary {
  [key: string]: Value;
}

// A path in @...@, which is relative to the layer that has it.
export class Asset {
  constructor(readonly path: string) {}
}

// A reference or payload: of `asset`, or of the same layers where that is empty.
export class Reference {
  constructor(readonly asset: string, readonly prim: string) {}
}

// An edited list: what replaces weaker lists, or what comes before and after them.
export interface ListEdit<T> {
  explicit?: T[];
  before?: T[];
  after?: T[];
  deleted?: T[];
}

// The values of an attribute at times, which rise.
export interface Samples {
  times: number[];
  values: Value[];
}

export interface Property {
  value?: Value;
  samples?: Samples;
  // Targets of a relationship, or the sources that an attribute is connected to.
  targets?: ListEdit<string>;
  meta: Dictionary;
}

export interface Prim {
  name: string;
  specifier: 'def'|'over'|'class';
  type: string;
  meta: Dictionary;
  references?: ListEdit<Reference>;
  payloads?: ListEdit<Reference>;
  inherits?: ListEdit<string>;
  specializes?: ListEdit<string>;
  properties: Map<string, Property>;
  children: Map<string, Prim>;
  // Variants by the names of their sets, then by their own.
  variants: Map<string, Map<string, Prim>>;
}

// The root has the file's metadata (`upAxis`, `subLayers` and so on) and the root prims.
export interface Layer {
  root: Prim;
}

// The file is not USD, or broken, or exceeds a limit. The message is shown as it is.
export class UsdError extends Error {}

export function newPrim(name: string, specifier: Prim['specifier'], type: string): Prim {
  return {
    name,
    specifier,
    type,
    meta: {},
    properties: new Map(),
    children: new Map(),
    variants: new Map(),
  };
}

export function propertyOf(prim: Prim, name: string): Property {
  let property = prim.properties.get(name);
  if (!property) {
    property = {meta: {}};
    prim.properties.set(name, property);
  }
  return property;
}

// The prim of a variant, made where there is none.
export function variantOf(prim: Prim, set: string, name: string): Prim {
  let variants = prim.variants.get(set);
  if (!variants) {
    variants = new Map();
    prim.variants.set(set, variants);
  }
  let variant = variants.get(name);
  if (!variant) {
    variant = newPrim(prim.name, 'over', '');
    variants.set(name, variant);
  }
  return variant;
}

export function isNumbers(value: Value|undefined): value is Numbers {
  return value instanceof Float32Array || value instanceof Float64Array ||
      value instanceof Int32Array || value instanceof Uint32Array ||
      (Array.isArray(value) && typeof value[0] !== 'string' && !(value[0] instanceof Reference));
}

export function isStrings(value: Value|undefined): value is string[] {
  return Array.isArray(value) && (value.length === 0 || typeof value[0] === 'string');
}
