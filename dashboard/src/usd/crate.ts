// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Reads layers in the binary form, .usdc ("crate"), versions 0.4 to 0.13. Source: OpenUSD's
// pxr/usd/sdf/crateFile.cpp and the core specification of the AOUSD, section 16.3.

import {CrateBytes} from './crate_bytes';
import {CrateValues, Edit} from './crate_values';
import type {FieldValue} from './crate_values';
import {newPrim, propertyOf, Reference, UsdError, variantOf} from './layer';
import type {Layer, ListEdit, Prim, Value} from './layer';

const SPECS_MAX = 20_000_000;
const DEPTH_MAX = 256;

enum SpecType {
  Attribute = 1,
  Prim = 6,
  PseudoRoot = 7,
  Relationship = 8,
  Variant = 10
}

// One element of a path; the whole path is that of its parent and this.
interface PathElement {
  parent: number;
  name: string;
  isProperty: boolean;
}

const SPECIFIERS = ['def', 'over', 'class'] as const;

export class CrateReader {
  private readonly tokens: string[];
  private readonly elements: (PathElement|undefined)[] = [];
  private readonly texts = new Map<number, string>();
  private readonly fields: {name: string; low: number; high: number}[] = [];
  private readonly fieldSets: Int32Array;
  private readonly sections = new Map < string, {
    start: number;
    size: number
  }
  > ();
  private readonly values: CrateValues;
  private readonly prims = new Map<number, Prim>();

  constructor(private readonly bytes: CrateBytes) {
    const version = bytes.header();
    for (const section of bytes.sections()) this.sections.set(section.name, section);
    this.enter('TOKENS');
    this.tokens = bytes.tokens();
    this.enter('STRINGS');
    const strings = Array.from({length: bytes.count(4)}, () => bytes.u32());
    this.values = new CrateValues(
        bytes, version, this.tokens, strings, i => this.elements[i] ? this.path(i) : '');
    this.enter('FIELDS');
    this.readFields();
    this.enter('FIELDSETS');
    this.fieldSets = bytes.integers(bytes.count(0));
    this.enter('PATHS');
    this.readPaths();
  }

  private enter(name: string) {
    const section = this.sections.get(name);
    if (!section) throw new UsdError(`it has no section ${name}`);
    this.bytes.seek(section.start);
  }

  private readFields() {
    const {bytes} = this;
    const names = bytes.integers(bytes.count(0));
    const reps = bytes.compressed(names.length * 8);
    const view = new DataView(reps.buffer, reps.byteOffset, reps.byteLength);
    names.forEach((name, i) => this.fields.push({
      name: this.tokens[name] ?? '',
      low: view.getUint32(i * 8, true),
      high: view.getUint32(i * 8 + 4, true),
    }));
  }

  private readPaths() {
    const {bytes} = this;
    bytes.count(0);
    const count = bytes.count(0);
    const paths = bytes.integers(count);
    const names = bytes.integers(count);
    const jumps = bytes.integers(count);
    // Still to be read: where it begins, and its parent.
    const open: {at: number; parent: number}[] = [{at: 0, parent: -1}];
    let steps = 0;
    for (let next = open.pop(); next; next = open.pop()) {
      let {at, parent} = next;
      while (at < count) {
        if (++steps > count) throw new UsdError('its paths form a circle');
        const path = paths[at]!;
        const name = names[at]!;
        const jump = jumps[at]!;
        const isProperty = name < 0;
        this.elements[path] = {parent, name: this.tokens[Math.abs(name)] ?? '', isProperty};
        if (jump > 0) open.push({at: at + jump, parent});
        if (jump > 0 || jump === -1)
          parent = path;
        else if (jump !== 0)
          break;
        at++;
      }
    }
  }

  // A path as text, as targets have it.
  private path(index: number, depth = 0): string {
    const known = this.texts.get(index);
    if (known !== undefined) return known;
    const element = this.elements[index];
    if (!element || depth > DEPTH_MAX) throw new UsdError('a path is not in its table');
    let text = '/';
    if (element.parent >= 0) {
      const parent = this.path(element.parent, depth + 1);
      const joint = element.isProperty           ? '.' :
          element.name.startsWith('{')           ? '' :
          parent === '/' || parent.endsWith('}') ? '' :
                                                   '/';
      text = parent + joint + element.name;
    }
    this.texts.set(index, text);
    return text;
  }

  layer(): Layer {
    const {bytes} = this;
    this.enter('SPECS');
    const count = bytes.count(0);
    if (count > SPECS_MAX) throw new UsdError(`it has ${count} specs; ${SPECS_MAX} are the limit`);
    const paths = bytes.integers(count);
    const sets = bytes.integers(count);
    const types = bytes.integers(count);
    const root = newPrim('', 'def', '');
    this.prims.set(paths[types.indexOf(SpecType.PseudoRoot)] ?? -1, root);
    for (let i = 0; i < count; i++) {
      const path = paths[i]!;
      const type = types[i]!;
      const fields = this.fieldsOf(sets[i]!);
      if (type === SpecType.Attribute || type === SpecType.Relationship) {
        this.readProperty(path, fields);
      } else if (
          type === SpecType.Prim || type === SpecType.PseudoRoot || type === SpecType.Variant) {
        readPrim(this.prim(path), fields);
      }
    }
    this.order(root);
    return {root};
  }

  // Children in the order of the file: specs come in any.
  private order(root: Prim) {
    const open = [root];
    for (let prim = open.pop(); prim; prim = open.pop()) {
      const names = prim.meta['primChildren'];
      const all = prim.children;
      const sorted: [string, Prim][] = [];
      for (const name of Array.isArray(names) ? names as string[] : []) {
        const child = all.get(name);
        if (child) sorted.push([name, child]);
        all.delete(name);
      }
      prim.children = new Map([...sorted, ...all]);
      open.push(...prim.children.values());
      for (const set of prim.variants.values()) open.push(...set.values());
    }
  }

  private prim(path: number, depth = 0): Prim {
    const known = this.prims.get(path);
    if (known) return known;
    const element = this.elements[path];
    if (!element || element.parent < 0 || depth > DEPTH_MAX) {
      throw new UsdError('a spec has a path that is not in its table');
    }
    const parent = this.prim(element.parent, depth + 1);
    const variant = /^\{([^=]*)=(.*)\}$/.exec(element.name);
    let prim: Prim;
    if (variant) {
      // A set of variants has a path as well, without a variant.
      prim = variant[2] === '' ? parent : variantOf(parent, variant[1]!, variant[2]!);
    } else {
      prim = newPrim(element.name, 'over', '');
      parent.children.set(element.name, prim);
    }
    this.prims.set(path, prim);
    return prim;
  }

  private fieldsOf(set: number): Map<string, FieldValue> {
    const result = new Map<string, FieldValue>();
    for (let i = set; i < this.fieldSets.length && this.fieldSets[i] !== -1; i++) {
      const field = this.fields[this.fieldSets[i]!];
      if (!field) throw new UsdError('a field is not in its table');
      if (UNREAD.has(field.name)) continue;
      result.set(field.name, this.values.read(field.low, field.high));
    }
    return result;
  }

  private readProperty(path: number, fields: Map<string, FieldValue>) {
    const element = this.elements[path];
    // Specs of targets have no name of their own; the relationship has all that is read.
    if (!element?.isProperty || element.parent < 0) return;
    const owner = this.elements[element.parent];
    if (!owner || owner.isProperty) return;
    const property = propertyOf(this.prim(element.parent), element.name);
    for (const [name, value] of fields) {
      if (name === 'default')
        property.value = value as Value;
      else if (name === 'timeSamples')
        property.samples = value as never;
      else if (name === 'connectionPaths' || name === 'targetPaths') {
        property.targets = listOf<string>(value);
      } else if (!(value instanceof Edit))
        property.meta[name] = value as Value;
    }
  }
}

// Large or without meaning here.
const UNREAD = new Set([
  'documentation',
  'comment',
  'properties',
  'connectionChildren',
  'targetChildren',
  'variantSetChildren',
  'variantChildren',
  'customData',
  'assetInfo',
  'apiSchemas',
  'customLayerData',
  'clips',
  'typeName.',
  'sdrMetadata',
  'symmetryArguments',
  'prefix',
  'suffix',
]);

function listOf<T>(value: FieldValue): ListEdit<T>|undefined {
  if (value instanceof Edit) return value.list as ListEdit<T>;
  if (value instanceof Reference) return {explicit: [value as T]};
  return undefined;
}

function readPrim(prim: Prim, fields: Map<string, FieldValue>) {
  for (const [name, value] of fields) {
    if (name === 'specifier')
      prim.specifier = SPECIFIERS[value as number] ?? 'over';
    else if (name === 'typeName')
      prim.type = String(value);
    else if (name === 'references')
      prim.references = listOf(value);
    else if (name === 'payload')
      prim.payloads = listOf(value);
    else if (name === 'inheritPaths')
      prim.inherits = listOf(value);
    else if (name === 'specializes')
      prim.specializes = listOf(value);
    else if (name === 'variantSelection')
      prim.meta['variants'] = value as Value;
    else if (!(value instanceof Edit) && !(value instanceof Reference)) {
      prim.meta[name] = value as Value;
    }
  }
}

// @throws UsdError
export function readCrate(bytes: Uint8Array): Layer {
  try {
    return new CrateReader(new CrateBytes(bytes)).layer();
  } catch (error) {
    if (error instanceof UsdError) throw error;
    if (error instanceof RangeError) throw new UsdError('it is cut off or broken');
    throw error;
  }
}
