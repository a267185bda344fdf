// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Materials: UsdPreviewSurface, and what MaterialX's surfaces have in common with it.

import {assetText} from './assets';
import type {Glb, JsonObject} from './glb';
import {isNumbers} from './layer';
import type {Note} from './mesh';
import {srgbToLinear} from './pixels';
import type {Pixels} from './pixels';
import type {StagePrim} from './stage';
import {sourceOf, Textures} from './textures';
import type {Input, Texture} from './textures';

// Names of inputs by surface.
interface Names {
  color: string;
  metallic: string;
  roughness: string;
  emission: string;
  emissionWeight?: string;
  opacity: string;
  normal: string;
  coat: string;
  coatRoughness: string;
  ior: string;
  transmission?: string;
}

const PREVIEW: Names = {
  color: 'diffuseColor',
  metallic: 'metallic',
  roughness: 'roughness',
  emission: 'emissiveColor',
  opacity: 'opacity',
  normal: 'normal',
  coat: 'clearcoat',
  coatRoughness: 'clearcoatRoughness',
  ior: 'ior',
};
const STANDARD: Names = {
  color: 'base_color',
  metallic: 'metalness',
  roughness: 'specular_roughness',
  emission: 'emission_color',
  emissionWeight: 'emission',
  opacity: 'opacity',
  normal: 'normal',
  coat: 'coat',
  coatRoughness: 'coat_roughness',
  ior: 'specular_IOR',
  transmission: 'transmission',
};
const OPEN_PBR: Names = {
  color: 'base_color',
  metallic: 'base_metalness',
  roughness: 'specular_roughness',
  emission: 'emission_color',
  emissionWeight: 'emission_luminance',
  opacity: 'geometry_opacity',
  normal: 'geometry_normal',
  coat: 'coat_weight',
  coatRoughness: 'coat_roughness',
  ior: 'specular_ior',
  transmission: 'transmission_weight',
};

const DEFAULTS: Record<string, number[]> = {
  diffuseColor: [0.18, 0.18, 0.18],
  base_color: [0.8, 0.8, 0.8],
  metallic: [0],
  metalness: [0],
  base_metalness: [0],
  roughness: [0.5],
  specular_roughness: [0.2],
  emissiveColor: [0, 0, 0],
  emission_color: [1, 1, 1],
  emission: [0],
  emission_luminance: [0],
  opacity: [1],
  geometry_opacity: [1],
  clearcoat: [0],
  coat: [0],
  coat_weight: [0],
  clearcoatRoughness: [0.01],
  coat_roughness: [0.1],
  ior: [1.5],
  specular_IOR: [1.5],
  specular_ior: [1.5],
  transmission: [0],
  transmission_weight: [0],
};

// A material of the glTF, and the primvars of its texture coordinates, in their order.
export interface Material {
  index: number;
  uvs: string[];
  usesColors: boolean;
}

const CHANNELS = 'rgba';
const DIELECTRIC = 0.04;

const near = (a: number[], b: number[]) => b.every((v, i) => Math.abs((a[i] ?? 0) - v) < 1e-5);
const clamp = (v: number) => Math.min(255, Math.max(0, Math.round(v)));

export class Materials {
  private readonly known = new Map<string, Material>();
  private readonly textures: Textures;

  constructor(private readonly glb: Glb, textures: Textures, private readonly note: Note) {
    this.textures = textures;
  }

  // The material that is bound to a prim or, more weakly, to an ancestor.
  static bound(prim: StagePrim): StagePrim|undefined {
    let result: StagePrim|undefined;
    for (let at: StagePrim|undefined = prim; at; at = at.parent) {
      for (const name
               of ['material:binding', 'material:binding:preview', 'material:binding:full']) {
        const path = at.targets(name)[0];
        const material = path === undefined ? undefined : at.stage.prim(path);
        if (!material || material.type !== 'Material') continue;
        const isStrong = at.bindingIsStrong(name);
        if (!result || isStrong) result = material;
        break;
      }
    }
    return result;
  }

  // `key` is the same for copies of a material.
  get(prim: StagePrim|undefined, key: string, isDoubleSided: boolean, hasColors: boolean,
      isClear: boolean): Material {
    const full = `${key} ${isDoubleSided} ${hasColors} ${isClear}`;
    let material = this.known.get(full);
    if (!material) {
      material = this.make(prim, isDoubleSided, hasColors || isClear);
      if (isClear && material.usesColors)
        this.glb.materials[material.index]!['alphaMode'] = 'BLEND';
      this.known.set(full, material);
    }
    return material;
  }

  private make(prim: StagePrim|undefined, isDoubleSided: boolean, hasColors: boolean): Material {
    const uvs: string[] = [];
    const json: JsonObject = {doubleSided: isDoubleSided};
    let usesColors = false;
    const surface = prim && this.surface(prim);
    if (surface) {
      json['name'] = prim.name;
      usesColors = new Surface(this.glb, this.textures, surface.prim, surface.names, this.note, uvs)
                       .write(json);
    } else {
      const value = hasColors ? 1 : 0.18;
      json['pbrMetallicRoughness'] = {
        baseColorFactor: [value, value, value, 1],
        metallicFactor: 0,
        roughnessFactor: 0.5,
      };
      usesColors = true;
      if (prim) this.note('materials without a surface that is known are gray', prim.path);
    }
    return {index: this.glb.materials.push(json) - 1, uvs, usesColors};
  }

  private surface(prim: StagePrim): {prim: StagePrim; names: Names}|undefined {
    const found: {prim: StagePrim; names: Names}[] = [];
    for (const output of ['outputs:surface', 'outputs:mtlx:surface']) {
      const source = sourceOf(prim, output);
      if (source.prim.type !== 'Shader') continue;
      const id = source.prim.string('info:id') ?? '';
      if (/UsdPreviewSurface/.test(id))
        found.unshift({prim: source.prim, names: PREVIEW});
      else if (/standard_surface/.test(id))
        found.push({prim: source.prim, names: STANDARD});
      else if (/open_pbr/.test(id))
        found.push({prim: source.prim, names: OPEN_PBR});
      else
        this.note('surfaces that are not known are gray', `${source.prim.path}: ${id}`);
    }
    const first = found[0];
    if (first && first.names !== PREVIEW) {
      this.note(
          'surfaces of MaterialX keep color, metalness, roughness, emission, coat and opacity',
          first.prim.path);
    }
    return first;
  }
}

// Writes one surface.
class Surface {
  constructor(
      private readonly glb: Glb, private readonly textures: Textures,
      private readonly prim: StagePrim, private readonly names: Names, private readonly note: Note,
      private readonly uvs: string[]) {}

  private readonly slot = (uv: string): number => {
    const index = this.uvs.indexOf(uv);
    return index >= 0 ? index : this.uvs.push(uv) - 1;
  };

  private input(name: string): Input&{numbers: number[]} {
    const input = this.textures.input(this.prim, name);
    const {value} = input;
    const numbers = isNumbers(value) ? Array.from(value as number[]) :
        typeof value === 'number'    ? [value] :
                                       DEFAULTS[name] ?? [0];
    return {...input, numbers};
  }

  private extension(json: JsonObject, name: string, value: JsonObject) {
    this.glb.extensions.add(name);
    json['extensions'] = {...json['extensions'] as JsonObject | undefined, [name]: value};
  }

  // Whether the colors of the vertices are used.
  write(json: JsonObject): boolean {
    const pbr: JsonObject = {};
    json['pbrMetallicRoughness'] = pbr;
    const color = this.input(this.names.color);
    const opacity = this.input(this.names.opacity);
    const usesColors = color.primvar === 'displayColor';
    if (color.primvar !== undefined && !usesColors) {
      this.note('colors from primvars other than displayColor are white', this.prim.path);
    }
    this.writeColor(json, pbr, color, opacity);
    this.writeRoughness(pbr);
    this.writeEmission(json);
    this.writeNormal(json);
    this.writeLayers(json);
    const displacement = this.input('displacement');
    if (displacement.texture || (displacement.numbers[0] ?? 0) !== 0) {
      this.note('displacement is left out', this.prim.path);
    }
    return usesColors;
  }

  private writeColor(
      json: JsonObject, pbr: JsonObject, color: Input&{numbers: number[]},
      opacity: Input&{numbers: number[]}) {
    const threshold = this.input('opacityThreshold').numbers[0] ?? 0;
    const alpha = opacity.texture ? 1 : opacity.numbers[0] ?? 1;
    const texture = color.texture;
    const isSame = texture && opacity.texture &&
        assetText(texture.image) === assetText(opacity.texture.image) &&
        opacity.texture.output === 'a';
    let factor = texture || color.primvar !== undefined ? [1, 1, 1] : color.numbers.slice(0, 3);
    const bias = texture?.bias.slice(0, 3) ?? [0, 0, 0];
    if (texture && near(bias, [0, 0, 0])) factor = texture.scale.slice(0, 3);
    const needsPacking = texture &&
        (!near(bias, [0, 0, 0]) || texture.output !== 'rgb' || texture.isRaw ||
         factor.some(f => f > 1));
    if (needsPacking) factor = [1, 1, 1];
    const reference = opacity.texture && !isSame ?
        this.packedColor(texture, opacity.texture, factor) :
        texture && needsPacking ? this.packedColor(texture, opacity.texture, factor) :
                                  texture && this.textures.use(texture, this.slot);
    if (reference) pbr['baseColorTexture'] = reference;
    pbr['baseColorFactor'] = [...factor.map(f => Math.min(1, Math.max(0, f))), Math.min(1, alpha)];
    if (opacity.texture ? reference : alpha < 1) {
      json['alphaMode'] = threshold > 0 ? 'MASK' : 'BLEND';
      if (threshold > 0) json['alphaCutoff'] = threshold;
    }
  }

  // Color and opacity in one image.
  private packedColor(color: Texture|undefined, opacity: Texture|undefined, factor: number[]) {
    const base = color ?? opacity!;
    const key = [color, opacity]
                    .map(t => t ? assetText(t.image) + t.output + t.scale + t.bias + t.isRaw : '')
                    .join('|') +
        factor.join();
    return this.textures.packed(base, key, () => {
      const from = color && this.textures.pixels(color);
      const alpha = opacity && this.textures.pixels(opacity);
      if ((color && !from) || (opacity && !alpha)) return undefined;
      return combined(
          [from, alpha],
          (a, at, b, bt) =>
              [...[0, 1, 2].map(k => from ? colorChannel(color!, a!, at, k) : 255),
               alpha ? scalar(opacity!, b!, bt) : 255,
      ]);
    }, this.slot);
  }

  private writeRoughness(pbr: JsonObject) {
    const metallic = this.input(this.names.metallic);
    const roughness = this.input(this.names.roughness);
    const isSpecular = this.input('useSpecularWorkflow').numbers[0] === 1;
    pbr['metallicFactor'] = isSpecular ? 0 :
        metallic.texture               ? 1 :
                                         Math.min(1, metallic.numbers[0] ?? 0);
    pbr['roughnessFactor'] = roughness.texture ? 1 : Math.min(1, roughness.numbers[0] ?? 0.5);
    const [m, r] = [isSpecular ? undefined : metallic.texture, roughness.texture];
    const base = r ?? m;
    if (!base) return;
    const plain = (t: Texture|undefined, output: string) => !t ||
        (t.output === output && near(t.scale, [1, 1, 1, 1]) && near(t.bias, [0, 0, 0, 0]) &&
         assetText(t.image) === assetText(base.image));
    const isPlain = m && r ? plain(m, 'b') && plain(r, 'g') : false;
    const key =
        [m, r].map(t => t ? assetText(t.image) + t.output + t.scale + t.bias : '').join('&');
    const reference =
        isPlain ? this.textures.use(base, this.slot) : this.textures.packed(base, key, () => {
          const [a, b] = [m && this.textures.pixels(m), r && this.textures.pixels(r)];
          if ((m && !a) || (r && !b)) return undefined;
          return combined(
              [a, b],
              (p, at, q,
               bt) => [255, r ? scalar(r, q!, bt) : 255, m ? scalar(m, p!, at) : 255, 255]);
        }, this.slot);
    if (reference) pbr['metallicRoughnessTexture'] = reference;
  }

  private writeEmission(json: JsonObject) {
    const emission = this.input(this.names.emission);
    const weight = this.names.emissionWeight === undefined ?
        1 :
        this.input(this.names.emissionWeight).numbers[0] ?? 0;
    const reference =
        weight > 0 && emission.texture && this.textures.use(emission.texture, this.slot);
    const color = (reference            ? emission.texture!.scale.slice(0, 3) :
                       emission.texture ? [0, 0, 0] :
                                          emission.numbers.slice(0, 3))
                      .map(v => Math.max(0, v * weight));
    const strength = Math.max(...color);
    if (!(strength > 0)) return;
    const divisor = Math.max(1, strength);
    json['emissiveFactor'] = color.map(v => v / divisor);
    if (reference) json['emissiveTexture'] = reference;
    if (strength > 1) {
      this.extension(json, 'KHR_materials_emissive_strength', {emissiveStrength: strength});
    }
  }

  private writeNormal(json: JsonObject) {
    const {texture} = this.input(this.names.normal);
    if (!texture) return;
    const {scale, bias} = texture;
    const isPlain = (near(scale, [2, 2, 2]) && near(bias, [-1, -1, -1])) ||
        (near(scale, [1, 1, 1]) && near(bias, [0, 0, 0]));
    const reference = isPlain ?
        this.textures.use(texture, this.slot) :
        this.textures.packed(texture, `${assetText(texture.image)}~${scale}~${bias}`, () => {
          const from = this.textures.pixels(texture);
          return from &&
              combined(
                     [from],
                     (p, at) =>
                         [...[0, 1, 2].map(
                              k => clamp(
                                  (p!.data[at + k]! / 255 * scale[k]! + bias[k]! + 1) * 127.5)),
                          255]);
        }, this.slot);
    if (reference) json['normalTexture'] = reference;
  }

  private writeLayers(json: JsonObject) {
    const ior = this.input(this.names.ior).numbers[0] ?? 1.5;
    if (this.input('useSpecularWorkflow').numbers[0] === 1) {
      const specular = this.input('specularColor');
      if (specular.texture) this.note('textures of specularColor are left out', this.prim.path);
      this.extension(
          json, 'KHR_materials_specular',
          {specularColorFactor: specular.numbers.slice(0, 3).map(v => v / DIELECTRIC)});
    } else if (Math.abs(ior - 1.5) > 1e-6 && ior >= 1) {
      this.extension(json, 'KHR_materials_ior', {ior});
    }
    const coat = this.input(this.names.coat);
    const coatRoughness = this.input(this.names.coatRoughness);
    if (coat.texture || coatRoughness.texture)
      this.note('textures of clearcoats are left out', this.prim.path);
    const weight = coat.numbers[0] ?? 0;
    if (weight > 0) {
      this.extension(json, 'KHR_materials_clearcoat', {
        clearcoatFactor: Math.min(1, weight),
        clearcoatRoughnessFactor: Math.min(1, coatRoughness.numbers[0] ?? 0),
      });
    }
    const {transmission} = this.names;
    const clear = transmission === undefined ? 0 : this.input(transmission).numbers[0] ?? 0;
    if (clear > 0) {
      this.extension(json, 'KHR_materials_transmission', {transmissionFactor: Math.min(1, clear)});
    }
  }
}

const linearToSrgb = (v: number) =>
    v <= 0.0031308 ? v * 12.92 : 1.055 * Math.max(0, v) ** (1 / 2.4) - 0.055;

// A channel of a color, as glTF wants it: by sRGB's curve.
function colorChannel(texture: Texture, pixels: Pixels, at: number, k: number): number {
  const channel = texture.output === 'rgb' ? k : Math.max(0, CHANNELS.indexOf(texture.output));
  const raw = pixels.data[at + channel]! / 255;
  const value = texture.isRaw ? raw : srgbToLinear(raw);
  return clamp(255 * linearToSrgb(value * texture.scale[k]! + texture.bias[k]!));
}

function scalar(texture: Texture, pixels: Pixels, at: number): number {
  const channel = Math.max(0, CHANNELS.indexOf(texture.output[0]!));
  return clamp(pixels.data[at + channel]! * texture.scale[channel]! + texture.bias[channel]! * 255);
}

type Mix = (a: Pixels|undefined, at: number, b: Pixels|undefined, bt: number) => number[];

// Pixels as many as the largest image has; of smaller ones the nearest.
function combined(images: (Pixels|undefined)[], mix: Mix): Pixels {
  const [a, b] = images;
  const width = Math.max(a?.width ?? 0, b?.width ?? 0);
  const height = Math.max(a?.height ?? 0, b?.height ?? 0);
  const data = new Uint8Array(width * height * 4);
  const place = (p: Pixels|undefined, x: number, y: number) =>
      p ? (Math.floor(y * p.height / height) * p.width + Math.floor(x * p.width / width)) * 4 : 0;
  for (let y = 0, at = 0; y < height; y++) {
    for (let x = 0; x < width; x++, at += 4)
      data.set(mix(a, place(a, x, y), b, place(b, x, y)), at);
  }
  return {width, height, data};
}
