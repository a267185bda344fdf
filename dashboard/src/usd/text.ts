// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Reads layers in the text form, .usda.

import {Asset, newPrim, propertyOf, Reference, UsdError, variantOf} from './layer';
import type {Dictionary, Layer, ListEdit, Prim, Property, Samples, Value} from './layer';
import {Scanner} from './scanner';

const DEPTH_MAX = 256;
const SPECIFIERS = new Set(['def', 'over', 'class']);
const EDITS = new Set(['prepend', 'append', 'add', 'delete', 'reorder']);

// Adds an edit to a list; `reorder` changes nothing that is read.
function edited<T>(list: ListEdit<T>|undefined, edit: string, items: T[]): ListEdit<T> {
  const result = list ?? {};
  if (edit === '')
    result.explicit = items;
  else if (edit === 'prepend')
    result.before = items;
  else if (edit === 'append' || edit === 'add')
    result.after = [...result.after ?? [], ...items];
  else if (edit === 'delete')
    result.deleted = items;
  return result;
}

class TextReader {
  private readonly scanner: Scanner;
  private depth = 0;

  constructor(text: string) {
    this.scanner = new Scanner(text);
  }

  layer(): Layer {
    const root = newPrim('', 'def', '');
    const {scanner} = this;
    if (scanner.accept('(')) this.metadata(root, root.meta);
    while (!scanner.atEnd()) {
      const word = scanner.word();
      if (SPECIFIERS.has(word))
        this.prim(root, word as Prim['specifier']);
      else if (word === 'reorder')
        this.skipStatement();
      else
        scanner.fail(`“${word}” begins nothing that is known here`);
    }
    return {root};
  }

  private enter() {
    if (++this.depth > DEPTH_MAX) this.scanner.fail(`nested deeper than ${DEPTH_MAX}`);
  }

  private skipStatement() {
    this.scanner.word();
    this.scanner.expect('=');
    this.value('');
  }

  private prim(parent: Prim, specifier: Prim['specifier']) {
    const {scanner} = this;
    this.enter();
    const type = scanner.peek() === '"' || scanner.peek() === '\'' ? '' : scanner.word();
    const name = scanner.string();
    let prim = parent.children.get(name);
    if (!prim) {
      prim = newPrim(name, specifier, type);
      parent.children.set(name, prim);
    }
    this.primBody(prim);
    this.depth--;
  }

  private primBody(prim: Prim) {
    const {scanner} = this;
    if (scanner.accept('(')) this.metadata(prim, prim.meta);
    scanner.expect('{');
    while (!scanner.accept('}')) {
      if (scanner.accept(';')) continue;
      const word = scanner.word();
      if (SPECIFIERS.has(word))
        this.prim(prim, word as Prim['specifier']);
      else if (word === 'variantSet')
        this.variantSet(prim);
      else if (word === 'reorder' && !/^rel\b/.test(scanner.rest(4)))
        this.skipStatement();
      else
        this.property(prim, word);
    }
  }

  private variantSet(prim: Prim) {
    const {scanner} = this;
    const set = scanner.string();
    scanner.expect('=');
    scanner.expect('{');
    this.enter();
    while (!scanner.accept('}')) this.primBody(variantOf(prim, set, scanner.string()));
    this.depth--;
  }

  private property(prim: Prim, first: string) {
    const {scanner} = this;
    let word = first;
    let edit = '';
    while (word === 'custom' || word === 'uniform' || word === 'varying' || word === 'config' ||
           EDITS.has(word)) {
      if (EDITS.has(word)) edit = word;
      word = scanner.word();
    }
    const type = scanner.accept('[') ? (scanner.expect(']'), word + '[]') : word;
    const fullName = scanner.word();
    const dot = fullName.indexOf('.');
    const name = dot < 0 ? fullName : fullName.slice(0, dot);
    const part = dot < 0 ? '' : fullName.slice(dot + 1);
    const property = propertyOf(prim, name);
    if (scanner.accept('=')) {
      if (type === 'rel' || part === 'connect') {
        property.targets = edited(property.targets, edit, this.paths());
      } else if (part === 'timeSamples') {
        property.samples = this.samples(type);
      } else if (part === '') {
        property.value = this.value(type);
      } else {
        this.value(type);  // A spline: only its value would matter.
      }
    }
    if (scanner.accept('(')) this.propertyMetadata(property);
  }

  private propertyMetadata(property: Property) {
    this.metadata(undefined, property.meta);
  }

  private samples(type: string): Samples {
    const {scanner} = this;
    const pairs: {time: number; value: Value}[] = [];
    scanner.expect('{');
    while (!scanner.accept('}')) {
      const time = scanner.number();
      scanner.expect(':');
      pairs.push({time, value: this.value(type)});
      scanner.accept(',');
    }
    pairs.sort((a, b) => a.time - b.time);
    return {times: pairs.map(p => p.time), values: pairs.map(p => p.value)};
  }

  // Paths in <...>, one or a list.
  private paths(): string[] {
    return this.listOf(() => this.scanner.path());
  }

  private listOf<T>(item: () => T): T[] {
    const {scanner} = this;
    if (scanner.acceptWord('None')) return [];
    if (!scanner.accept('[')) return [item()];
    const items: T[] = [];
    while (!scanner.accept(']')) {
      items.push(item());
      scanner.accept(',');
    }
    return items;
  }

  private reference(): Reference {
    const {scanner} = this;
    const asset = scanner.peek() === '@' ? scanner.asset() : '';
    const prim = scanner.peek() === '<' ? scanner.path() : '';
    if (scanner.accept('(')) this.metadata(undefined, {});
    return new Reference(asset, prim);
  }

  private subLayers(): string[] {
    return this.listOf(() => {
      const asset = this.scanner.asset();
      if (this.scanner.accept('(')) this.metadata(undefined, {});
      return asset;
    });
  }

  // The metadata after "(": of a prim, of the layer, or of a property without `prim`.
  private metadata(prim: Prim|undefined, meta: Dictionary) {
    const {scanner} = this;
    while (!scanner.accept(')')) {
      if (scanner.accept(';') || scanner.accept(',')) continue;
      const next = scanner.peek();
      if (next === '"' || next === '\'') {
        meta['documentation'] = scanner.string();
        continue;
      }
      let word = scanner.word();
      let edit = '';
      if (EDITS.has(word)) {
        edit = word;
        word = scanner.word();
      }
      scanner.expect('=');
      if (prim && this.arcs(prim, word, edit)) continue;
      meta[word] = this.value('');
    }
  }

  private arcs(prim: Prim, word: string, edit: string): boolean {
    const references = () => this.listOf(() => this.reference());
    if (word === 'references')
      prim.references = edited(prim.references, edit, references());
    else if (word === 'payload')
      prim.payloads = edited(prim.payloads, edit, references());
    else if (word === 'inherits')
      prim.inherits = edited(prim.inherits, edit, this.paths());
    else if (word === 'specializes')
      prim.specializes = edited(prim.specializes, edit, this.paths());
    else if (word === 'subLayers')
      prim.meta['subLayers'] = this.subLayers();
    else
      return false;
    return true;
  }

  private value(type: string): Value {
    const {scanner} = this;
    switch (scanner.peek()) {
      case '"':
      case '\'':
        return scanner.string();
      case '@':
        return new Asset(scanner.asset());
      case '<':
        return scanner.path();
      case '{':
        return this.dictionary();
      case '[':
      case '(':
        return turned(type, this.array());
    }
    if (!scanner.atNumber()) {
      const word = scanner.word();
      if (word === 'None') return null;
      if (word === 'true' || word === 'false') return word === 'true';
      if (word === 'AnimationBlock') return null;
      return word;
    }
    const number = scanner.number();
    return type === 'bool' ? number !== 0 : number;
  }

  private array(): Value {
    const numbers: number[] = [];
    const strings: string[] = [];
    this.elements(numbers, strings);
    return strings.length > 0 ? strings : numbers;
  }

  private elements(numbers: number[], strings: string[]) {
    const {scanner} = this;
    const close = scanner.accept('[') ? ']' : (scanner.expect('('), ')');
    this.enter();
    while (!scanner.accept(close)) {
      const next = scanner.peek();
      if (next === '[' || next === '(')
        this.elements(numbers, strings);
      else if (next === '"' || next === '\'')
        strings.push(scanner.string());
      else if (next === '@')
        strings.push(scanner.asset());
      else if (next === '<')
        strings.push(scanner.path());
      else if (scanner.acceptWord('true'))
        numbers.push(1);
      else if (scanner.acceptWord('false'))
        numbers.push(0);
      else
        numbers.push(scanner.number());
      scanner.accept(',');
    }
    this.depth--;
  }

  private dictionary(): Dictionary {
    const {scanner} = this;
    const result: Dictionary = {};
    scanner.expect('{');
    this.enter();
    while (!scanner.accept('}')) {
      if (scanner.accept(';') || scanner.accept(',')) continue;
      let word = scanner.word();
      const type = scanner.accept('[') ? (scanner.expect(']'), word + '[]') : word;
      const next = scanner.peek();
      word = next === '"' || next === '\'' ? scanner.string() : scanner.word();
      scanner.expect('=');
      result[word] = this.value(type);
    }
    this.depth--;
    return result;
  }
}

// Quaternions with their real part last, where the text has it first.
function turned(type: string, value: Value): Value {
  if (!type.startsWith('quat') || !Array.isArray(value)) return value;
  const numbers = value as number[];
  const result: number[] = [];
  for (let i = 0; i + 3 < numbers.length; i += 4) {
    result.push(numbers[i + 1]!, numbers[i + 2]!, numbers[i + 3]!, numbers[i]!);
  }
  return result;
}

// @throws UsdError with the line of what is wrong
export function readText(bytes: Uint8Array): Layer {
  const text = new TextDecoder().decode(bytes);
  if (!text.startsWith('#usda')) throw new UsdError('it does not begin with #usda');
  return new TextReader(text).layer();
}
