// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Collects what a .glb file has, and writes it.

import {UsdError} from './layer';

const BYTES_MAX = 0xF0000000;
const FLOAT = 5126;
const UNSIGNED = 5125;

export type Json = null|boolean|number|string|Json[]|{[key: string]: Json | undefined};
export type JsonObject = {
  [key: string]: Json|undefined
};

export interface GltfNode {
  name?: string;
  matrix?: number[];
  translation?: number[];
  rotation?: number[];
  scale?: number[];
  children?: number[];
  mesh?: number;
  skin?: number;
  camera?: number;
  extensions?: JsonObject;
}

type Sized = 'SCALAR'|'VEC2'|'VEC3'|'VEC4'|'MAT4';
const SIZES: Record<Sized, number> = {
  SCALAR: 1,
  VEC2: 2,
  VEC3: 3,
  VEC4: 4,
  MAT4: 16
};

export class Glb {
  readonly nodes: GltfNode[] = [];
  readonly meshes: JsonObject[] = [];
  readonly materials: JsonObject[] = [];
  readonly textures: JsonObject[] = [];
  readonly samplers: JsonObject[] = [];
  readonly images: JsonObject[] = [];
  readonly cameras: JsonObject[] = [];
  readonly skins: JsonObject[] = [];
  readonly lights: JsonObject[] = [];
  readonly channels: JsonObject[] = [];
  readonly animationSamplers: JsonObject[] = [];
  readonly extensions = new Set<string>();
  private readonly accessors: JsonObject[] = [];
  private readonly views: JsonObject[] = [];
  private readonly parts: Uint8Array[] = [];
  private size = 0;

  node(node: GltfNode, parent?: number): number {
    const index = this.nodes.push(node) - 1;
    if (parent !== undefined) (this.nodes[parent]!.children ??= []).push(index);
    return index;
  }

  view(bytes: Uint8Array): number {
    const padding = (4 - bytes.length % 4) % 4;
    this.views.push({buffer: 0, byteOffset: this.size, byteLength: bytes.length});
    this.parts.push(bytes, new Uint8Array(padding));
    this.size += bytes.length + padding;
    if (this.size > BYTES_MAX) throw new UsdError('its data are more than 4 GiB as glTF');
    return this.views.length - 1;
  }

  floats(type: Sized, data: Float32Array, hasBounds = false): number {
    const size = SIZES[type];
    const accessor: JsonObject = {
      bufferView: this.view(new Uint8Array(data.buffer, data.byteOffset, data.byteLength)),
      componentType: FLOAT,
      count: data.length / size,
      type,
    };
    if (hasBounds) {
      const [min, max] =
          [new Array<number>(size).fill(Infinity), new Array<number>(size).fill(-Infinity)];
      data.forEach((v, i) => {
        min[i % size] = Math.min(min[i % size]!, v);
        max[i % size] = Math.max(max[i % size]!, v);
      });
      accessor['min'] = min;
      accessor['max'] = max;
    }
    return this.accessors.push(accessor) - 1;
  }

  indices(data: Uint32Array): number {
    const view = this.view(new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
    return this.accessors.push(
               {bufferView: view, componentType: UNSIGNED, count: data.length, type: 'SCALAR'}) -
        1;
  }

  joints(data: Uint16Array): number {
    const view = this.view(new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
    return this.accessors.push(
               {bufferView: view, componentType: 5123, count: data.length / 4, type: 'VEC4'}) -
        1;
  }

  // Keys of a node's property; `times` are an accessor of seconds.
  channel(node: number, path: string, times: number, type: Sized, values: Float32Array) {
    const sampler =
        this.animationSamplers.push(
            {input: times, output: this.floats(type, values), interpolation: 'LINEAR'}) -
        1;
    this.channels.push({sampler, target: {node, path}});
  }

  write(roots: number[]): Uint8Array {
    const used = <T>(list: T[]) => list.length > 0 ? list as Json : undefined;
    const animations = this.channels.length === 0 ?
        undefined :
        [{channels: this.channels, samplers: this.animationSamplers}];
    if (this.lights.length > 0) this.extensions.add('KHR_lights_punctual');
    const json: JsonObject = {
      asset: {version: '2.0', generator: 'Sheaf, from USD'},
      scene: 0,
      scenes: [{nodes: roots}],
      nodes: used(this.nodes),
      meshes: used(this.meshes),
      materials: used(this.materials),
      textures: used(this.textures),
      samplers: used(this.samplers),
      images: used(this.images),
      cameras: used(this.cameras),
      skins: used(this.skins),
      animations: animations as Json,
      accessors: used(this.accessors),
      bufferViews: used(this.views),
      buffers: this.size > 0 ? [{byteLength: this.size}] : undefined,
      extensionsUsed: used([...this.extensions]),
      extensions: this.lights.length > 0 ? {KHR_lights_punctual: {lights: this.lights}} : undefined,
    };
    const text = new TextEncoder().encode(JSON.stringify(json));
    const textSize = text.length + (4 - text.length % 4) % 4;
    const total = 12 + 8 + textSize + (this.size > 0 ? 8 + this.size : 0);
    const result = new Uint8Array(total).fill(0x20);
    const view = new DataView(result.buffer);
    [0x46546C67, 2, total, textSize, 0x4E4F534A].forEach((v, i) => view.setUint32(i * 4, v, true));
    result.set(text, 20);
    if (this.size > 0) {
      let at = 20 + textSize;
      view.setUint32(at, this.size, true);
      view.setUint32(at + 4, 0x004E4942, true);
      at += 8;
      for (const part of this.parts) {
        result.set(part, at);
        at += part.length;
      }
    }
    return result;
  }
}
