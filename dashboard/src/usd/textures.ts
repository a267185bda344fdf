// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Textures of shading networks, and their images in the glTF.

import {assetText} from './assets';
import type {AssetId, Assets} from './assets';
import type {Glb, JsonObject} from './glb';
import {Asset, isNumbers} from './layer';
import type {Value} from './layer';
import type {Note} from './mesh';
import {decodeImage, encodePng, imageKind} from './pixels';
import type {Pixels} from './pixels';
import type {StagePrim} from './stage';

// A texture as an input of a surface has it.
export interface Texture {
  image: AssetId;
  // r, g, b, a, rgb.
  output: string;
  scale: number[];
  bias: number[];
  isRaw: boolean;
  wrap: [number, number];
  // The primvar of its coordinates.
  uv: string;
  transform?: JsonObject;
}

// An input's value or texture, or the primvar that it is read from.
export interface Input {
  value?: Value;
  texture?: Texture;
  primvar?: string;
}

const WRAPS: Record<string, number> = {
  repeat: 10497,
  periodic: 10497,
  mirror: 33648,
  clamp: 33071,
  black: 33071,
};
const LINKS_MAX = 64;

// Where an input comes from: a shader's output, or the place that has its value.
export function sourceOf(prim: StagePrim, input: string): {prim: StagePrim; name: string} {
  let at = prim;
  let name = input;
  for (let i = 0; i < LINKS_MAX; i++) {
    const [path, output] = (at.targets(name)[0] ?? '').split('.');
    const next = path ? at.stage.prim(path) : undefined;
    if (!next || !output) break;
    at = next;
    name = output;
    if (at.type === 'Shader') break;
  }
  return {prim: at, name};
}

// The value of an input, through the interfaces of materials and node graphs.
export function valueOf(prim: StagePrim, input: string): Value|undefined {
  const source = sourceOf(prim, input);
  return source.name.startsWith('inputs:') ? source.prim.value(source.name) : undefined;
}

function numbersOf(prim: StagePrim, input: string, otherwise: number[]): number[] {
  const value = valueOf(prim, input);
  return isNumbers(value) && value.length >= otherwise.length ? Array.from(value as number[]) :
                                                                otherwise;
}

export class Textures {
  private readonly images = new Map<string, number>();
  private readonly samplers = new Map<string, number>();
  private readonly textures = new Map<string, number>();

  constructor(
      private readonly glb: Glb, private readonly assets: Assets, private readonly note: Note) {}

  // An input of a surface.
  input(surface: StagePrim, name: string): Input {
    const source = sourceOf(surface, 'inputs:' + name);
    if (source.name.startsWith('inputs:')) return {value: source.prim.value(source.name)};
    const id = source.prim.string('info:id') ?? '';
    if (id === 'UsdUVTexture' || /^ND_(tiled)?image_/.test(id)) {
      return {texture: this.texture(source.prim, source.name.replace(/^outputs:/, ''), id)};
    }
    if (/^UsdPrimvarReader_float3|^ND_geomcolor|^ND_geompropvalue_color/.test(id)) {
      const variable = valueOf(source.prim, 'inputs:varname');
      return {primvar: typeof variable === 'string' ? variable : 'displayColor'};
    }
    if (/^ND_normalmap/.test(id)) return this.input(source.prim, 'in');
    this.note('shading nodes that are not known are left out', `${source.prim.path}: ${id}`);
    return {};
  }

  private texture(shader: StagePrim, output: string, id: string): Texture|undefined {
    const source = sourceOf(shader, 'inputs:file');
    const attribute = source.prim.attribute(source.name);
    const value = attribute?.samples?.values[0] ?? attribute?.value;
    if (!attribute || !(value instanceof Asset) || value.path === '') return undefined;
    const path = value.path.replace('<UDIM>', '1001');
    if (path !== value.path) this.note('of textures by UDIM the first tile is shown', value.path);
    const image = this.assets.resolve(attribute.id, path);
    if (!image || !this.assets.bytes(image)) {
      this.note('textures that are not there are left out', value.path);
      return undefined;
    }
    const wrap = (axis: string): number => {
      const mode = valueOf(shader, 'inputs:wrap' + axis) ??
          valueOf(shader, axis === 'S' ? 'inputs:uaddressmode' : 'inputs:vaddressmode');
      return WRAPS[typeof mode === 'string' ? mode : 'repeat'] ?? 10497;
    };
    const space = valueOf(shader, 'inputs:sourceColorSpace') ?? attribute.meta['colorSpace'];
    const coordinates = this.coordinates(shader, id.startsWith('ND_') ? 'texcoord' : 'st');
    return {
      image,
      output: /^rgb|^out$/.test(output) ? 'rgb' : output,
      scale: numbersOf(shader, 'inputs:scale', [1, 1, 1, 1]),
      bias: numbersOf(shader, 'inputs:bias', [0, 0, 0, 0]),
      isRaw: space === 'raw' || space === 'lin_rec709' || space === 'Raw',
      wrap: [wrap('S'), wrap('T')],
      ...coordinates,
    };
  }

  // The primvar of the coordinates, and how they are changed, with v downwards as in glTF.
  private coordinates(shader: StagePrim, input: string): {uv: string; transform?: JsonObject} {
    let source = sourceOf(shader, 'inputs:' + input);
    let transform: JsonObject|undefined;
    if (source.prim.string('info:id') === 'UsdTransform2d') {
      const prim = source.prim;
      const angle = Number(valueOf(prim, 'inputs:rotation') ?? 0) * Math.PI / 180;
      const [sx, sy] = numbersOf(prim, 'inputs:scale', [1, 1]) as [number, number];
      const [tx, ty] = numbersOf(prim, 'inputs:translation', [0, 0]) as [number, number];
      transform = {
        rotation: angle,
        scale: [sx, sy],
        offset: [tx - Math.sin(angle) * sy, 1 - Math.cos(angle) * sy - ty],
      };
      source = sourceOf(prim, 'inputs:in');
    }
    const name = valueOf(source.prim, 'inputs:varname') ?? valueOf(source.prim, 'inputs:geomprop');
    return {uv: typeof name === 'string' ? name : '', transform};
  }

  // A glTF reference to a texture that is used as it is.
  use(texture: Texture, slot: (uv: string) => number): JsonObject|undefined {
    const image = this.image(texture.image);
    return image === undefined ? undefined : this.reference(texture, image, slot);
  }

  // A reference to a new image, whose pixels are computed; `key` names it uniquely.
  packed(
      texture: Texture, key: string, pixels: () => Pixels | undefined,
      slot: (uv: string) => number): JsonObject|undefined {
    let image = this.images.get(key);
    if (image === undefined) {
      const made = pixels();
      if (!made) return undefined;
      image = this.addImage(key, encodePng(made), 'image/png');
    }
    return this.reference(texture, image, slot);
  }

  pixels(texture: Texture): Pixels|undefined {
    const bytes = this.assets.bytes(texture.image);
    const pixels = bytes && decodeImage(bytes);
    if (!pixels)
      this.note('textures that cannot be changed are left out', assetText(texture.image));
    return pixels;
  }

  private reference(texture: Texture, image: number, slot: (uv: string) => number): JsonObject {
    const key = texture.wrap.join();
    let sampler = this.samplers.get(key);
    if (sampler === undefined) {
      sampler = this.glb.samplers.push({wrapS: texture.wrap[0], wrapT: texture.wrap[1]}) - 1;
      this.samplers.set(key, sampler);
    }
    const textureKey = `${image},${sampler}`;
    let index = this.textures.get(textureKey);
    if (index === undefined) {
      const isWebp = this.glb.images[image]!['mimeType'] === 'image/webp';
      if (isWebp) this.glb.extensions.add('EXT_texture_webp');
      const source = isWebp ? {extensions: {EXT_texture_webp: {source: image}}} : {source: image};
      index = this.glb.textures.push({sampler, ...source}) - 1;
      this.textures.set(textureKey, index);
    }
    const result: JsonObject = {index, texCoord: slot(texture.uv)};
    if (texture.transform) {
      this.glb.extensions.add('KHR_texture_transform');
      result['extensions'] = {KHR_texture_transform: texture.transform};
    }
    return result;
  }

  private image(id: AssetId): number|undefined {
    const text = assetText(id);
    const known = this.images.get(text);
    if (known !== undefined) return known;
    const bytes = this.assets.bytes(id)!;
    const kind = imageKind(bytes);
    if (!kind) {
      this.note('textures that are neither PNG nor JPEG nor WebP are left out', text);
      return undefined;
    }
    return this.addImage(text, bytes, kind);
  }

  private addImage(key: string, bytes: Uint8Array, mimeType: string): number {
    const index = this.glb.images.push({bufferView: this.glb.view(bytes), mimeType}) - 1;
    this.images.set(key, index);
    return index;
  }
}
