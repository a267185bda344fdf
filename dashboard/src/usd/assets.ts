// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Files by the names that layers give them, and those within packages (.usdz).

import {readCrate} from './crate';
import {UsdError} from './layer';
import type {Layer} from './layer';
import {readText} from './text';

const ENTRIES_MAX = 65_536;

// Where files come from: a folder, or the files dropped on a page. Undefined: there is none.
export type ReadFile = (path: string) => Uint8Array|undefined;

// Joins a folder and a path, without "." and ".."; undefined: it leaves the outermost folder.
export function joinPath(folder: string, path: string): string|undefined {
  if (path.startsWith('/') || /^[a-z][a-z0-9+.\-]+:/i.test(path)) return undefined;
  const parts = folder === '' ? [] : folder.split('/');
  for (const part of path.replaceAll('\\', '/').split('/')) {
    if (part === '' || part === '.') continue;
    if (part === '..') {
      if (parts.pop() === undefined) return undefined;
    } else {
      parts.push(part);
    }
  }
  return parts.join('/');
}

const folderOf = (path: string) => path.slice(0, Math.max(0, path.lastIndexOf('/')));

// The entries of a package, which are not compressed, in their order.
function packageEntries(bytes: Uint8Array): Map<string, Uint8Array> {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  let end = bytes.length - 22;
  while (end >= 0 && view.getUint32(end, true) !== 0x06054B50) end--;
  if (end < 0) throw new UsdError('it is cut off, or no zip file');
  const count = view.getUint16(end + 10, true);
  let at = view.getUint32(end + 16, true);
  const entries = new Map<string, Uint8Array>();
  if (count > ENTRIES_MAX) throw new UsdError(`it has more than ${ENTRIES_MAX} files`);
  for (let i = 0; i < count; i++) {
    if (view.getUint32(at, true) !== 0x02014B50) throw new UsdError('its table of files is broken');
    const method = view.getUint16(at + 10, true);
    const size = view.getUint32(at + 24, true);
    const nameSize = view.getUint16(at + 28, true);
    const name = new TextDecoder().decode(bytes.subarray(at + 46, at + 46 + nameSize));
    const local = view.getUint32(at + 42, true);
    at += 46 + nameSize + view.getUint16(at + 30, true) + view.getUint16(at + 32, true);
    if (name.endsWith('/')) continue;
    if (method !== 0) throw new UsdError(`${name} is compressed, which packages of USD may not be`);
    const begin = local + 30 + view.getUint16(local + 26, true) + view.getUint16(local + 28, true);
    if (begin + size > bytes.length) throw new UsdError('it is cut off');
    entries.set(name, bytes.subarray(begin, begin + size));
  }
  return entries;
}

// An asset: a file, or `inner` of the package `file`. Its text is unique and shown to people, such
// as `toy.usdz[textures/red.png]`.
export interface AssetId {
  file: string;
  inner: string;
}

export function assetText(id: AssetId): string {
  return id.inner === '' ? id.file : `${id.file}[${id.inner}]`;
}

export class Assets {
  private readonly packages = new Map<string, Map<string, Uint8Array>>();
  private readonly layers = new Map<string, Layer>();

  constructor(private readonly readFile: ReadFile) {}

  // The asset that a path of a layer names; undefined if there is no such file, or not in reach.
  resolve(from: AssetId, path: string): AssetId|undefined {
    const inner = /^(.*?)\[(.*)\]$/.exec(path);
    if (inner) return {file: joinPath(folderOf(from.file), inner[1]!) ?? '', inner: inner[2]!};
    if (from.inner === '') {
      const file = joinPath(folderOf(from.file), path);
      return file === undefined ? undefined : this.root({file, inner: ''});
    }
    const entries = this.package(from.file);
    for (const folder of [folderOf(from.inner), '']) {
      const name = joinPath(folder, path);
      if (name !== undefined && entries.has(name)) return {file: from.file, inner: name};
    }
    return undefined;
  }

  // The file itself, or for a package its first layer.
  root(id: AssetId): AssetId {
    if (id.inner !== '' || !id.file.toLowerCase().endsWith('.usdz')) return id;
    const first = [...this.package(id.file).keys()][0];
    if (first === undefined) throw new UsdError(`${id.file}: it is empty`);
    return {file: id.file, inner: first};
  }

  private package(file: string): Map<string, Uint8Array> {
    let entries = this.packages.get(file);
    if (!entries) {
      const bytes = this.readFile(file);
      try {
        entries = bytes ? packageEntries(bytes) : new Map<string, Uint8Array>();
      } catch (error) {
        if (error instanceof UsdError) throw new UsdError(`${file}: ${error.message}`);
        if (error instanceof RangeError) throw new UsdError(`${file}: it is cut off or broken`);
        throw error;
      }
      this.packages.set(file, entries);
    }
    return entries;
  }

  bytes(id: AssetId): Uint8Array|undefined {
    return id.inner === '' ? this.readFile(id.file) : this.package(id.file).get(id.inner);
  }

  // @throws UsdError, which names the file; undefined: there is none
  layer(id: AssetId): Layer|undefined {
    const text = assetText(id);
    let layer = this.layers.get(text);
    if (!layer) {
      const bytes = this.bytes(id);
      if (!bytes) return undefined;
      try {
        layer = readLayer(bytes);
      } catch (error) {
        if (error instanceof UsdError) throw new UsdError(`${text}: ${error.message}`);
        throw error;
      }
      this.layers.set(text, layer);
    }
    return layer;
  }
}

function readLayer(bytes: Uint8Array): Layer {
  const begin = String.fromCharCode(...bytes.subarray(0, 8));
  if (begin === 'PXR-USDC') return readCrate(bytes);
  if (begin.startsWith('#usda')) return readText(bytes);
  if (bytes.length === 0) throw new UsdError('it is empty');
  throw new UsdError('it is no USD: it begins neither with PXR-USDC nor with #usda');
}
