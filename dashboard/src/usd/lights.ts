// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Lights of UsdLux: areas as surfaces that emit, the others by KHR_lights_punctual. Source:
// OpenUSD's pxr/usd/usdLux/overview.dox, "Quantities and units".

import type {Glb, GltfNode, JsonObject} from './glb';
import {Asset, isNumbers} from './layer';
import type {Value} from './layer';
import type {Matrix} from './matrix';
import type {Note} from './mesh';
import type {StagePrim} from './stage';

const AROUND = 48;
const FULL_CONE = 90;

// An input, also by the name that it had before 21.02.
function input(prim: StagePrim, name: string): Value|undefined {
  return prim.value('inputs:' + name) ?? prim.value(name);
}

function number(prim: StagePrim, name: string, otherwise: number): number {
  const value = input(prim, name);
  return typeof value === 'number' ? value : otherwise;
}

// The color of a black body, with a luminance of 1; a fit to the Planckian locus (Kim et al. 2002).
export function temperatureColor(kelvin: number): number[] {
  const t = 1000 / Math.min(25000, Math.max(1667, kelvin));
  const x = kelvin <= 4000 ? ((-0.2661239 * t - 0.2343589) * t + 0.8776956) * t + 0.179910 :
                             ((-3.0258469 * t + 2.1070379) * t + 0.2226347) * t + 0.240390;
  const y = kelvin <= 2222 ? ((-1.1063814 * x - 1.34811020) * x + 2.18555832) * x - 0.20219683 :
      kelvin <= 4000       ? ((-0.9549476 * x - 1.37418593) * x + 2.09137015) * x - 0.16748867 :
                             ((3.0817580 * x - 5.87338670) * x + 3.75112997) * x - 0.37001483;
  const [X, Z] = [x / y, (1 - x - y) / y];
  return [
    3.2406 * X - 1.5372 - 0.4986 * Z, -0.9689 * X + 1.8758 + 0.0415 * Z,
    0.0557 * X - 0.2040 + 1.0570 * Z
  ].map(v => Math.max(0, v));
}

// Radiance before a division by the area.
export function emission(prim: StagePrim): number[] {
  const strength = number(prim, 'intensity', prim.type === 'DistantLight' ? 50000 : 1) * 2 **
      number(prim, 'exposure', 0);
  const value = input(prim, 'color');
  const color = isNumbers(value) ? Array.from(value as number[]) : [1, 1, 1];
  const warmth = input(prim, 'enableColorTemperature') === true ?
      temperatureColor(number(prim, 'colorTemperature', 6500)) :
      [1, 1, 1];
  return [0, 1, 2].map(i => strength * (color[i] ?? 1) * warmth[i]!);
}

// Lengths of the axes of a matrix.
function scales(world: Matrix): number[] {
  return [0, 1, 2].map(i => Math.hypot(world[i * 4]!, world[i * 4 + 1]!, world[i * 4 + 2]!));
}

interface Outline {
  points: number[];
  faces: number[];
  area: number;
}

// A flat light, which emits towards -z.
function flat(points: number[], area: number): Outline {
  const faces: number[] = [];
  for (let i = 2; i < points.length / 3; i++) faces.push(0, i, i - 1);
  return {points, faces, area};
}

function grid(rows: number, at: (u: number, v: number) => number[], area: number): Outline {
  const points: number[] = [];
  const faces: number[] = [];
  for (let r = 0; r <= rows; r++)
    for (let i = 0; i <= AROUND; i++) points.push(...at(i / AROUND, r / rows));
  for (let r = 0; r < rows; r++) {
    for (let i = 0; i < AROUND; i++) {
      const a = r * (AROUND + 1) + i;
      faces.push(a, a + 1, a + AROUND + 2, a, a + AROUND + 2, a + AROUND + 1);
    }
  }
  return {points, faces, area};
}

function outline(prim: StagePrim, s: number[]): Outline|undefined {
  const radius = number(prim, 'radius', 0.5);
  const turn = 2 * Math.PI;
  switch (prim.type) {
    case 'RectLight': {
      const [w, h] = [number(prim, 'width', 1), number(prim, 'height', 1)];
      return flat([-w, -h, 0, w, -h, 0, w, h, 0, -w, h, 0].map(v => v / 2), w * h * s[0]! * s[1]!);
    }
    case 'DiskLight':
      return flat(
          Array
              .from(
                  {length: AROUND},
                  (_, i) =>
                      [radius * Math.cos(turn * i / AROUND), radius * Math.sin(turn * i / AROUND),
                       0])
              .flat(),
          Math.PI * radius * radius * s[0]! * s[1]!);
    case 'SphereLight':
      return grid(AROUND / 2, (u, v) => {
        const [a, b] = [turn * u, Math.PI * (v - 0.5)];
        return [
          radius * Math.cos(a) * Math.cos(b), radius * Math.sin(a) * Math.cos(b),
          radius * Math.sin(b)
        ];
      }, 2 * turn * (radius * s[0]!) ** 2);
    case 'CylinderLight': {
      const length = number(prim, 'length', 1);
      return grid(
          1,
          (u, v) => [length * (v - 0.5), radius * Math.cos(turn * u), radius * Math.sin(turn * u)],
          turn * radius * s[1]! * length * s[0]!);
    }
    default:
      return undefined;
  }
}

export class Lights {
  count = 0;

  // `metersPerUnit` is of the stage, `world` of the light before it.
  constructor(
      private readonly glb: Glb, private readonly metersPerUnit: number,
      private readonly note: Note) {}

  // Adds the light to its node. False: the prim is no such light.
  add(prim: StagePrim, node: GltfNode, index: number, world: Matrix): boolean {
    if (prim.type === 'DistantLight') {
      this.distant(prim, index);
    } else {
      const s = scales(world);
      const shape = outline(prim, s);
      if (!shape) return false;
      const cone = number(prim, 'shaping:cone:angle', FULL_CONE);
      if (prim.type === 'SphereLight' &&
          (prim.value('treatAsPoint') === true || cone < FULL_CONE)) {
        this.point(prim, index, s, cone);
      } else {
        if (cone < FULL_CONE) this.note('cones of lights with an area are left out', prim.path);
        this.area(prim, node, shape);
      }
    }
    if (input(prim, 'texture:file') instanceof Asset)
      this.note('textures of lights are left out', prim.path);
    if (number(prim, 'shaping:focus', 0) !== 0 ||
        input(prim, 'shaping:ies:file') instanceof Asset) {
      this.note('focus and IES profiles of lights are left out', prim.path);
    }
    this.count++;
    return true;
  }

  private punctual(light: JsonObject, parent: number) {
    this.glb.lights.push(light);
    this.glb.node({extensions: {KHR_lights_punctual: {light: this.glb.lights.length - 1}}}, parent);
  }

  private normalized(prim: StagePrim): boolean {
    return input(prim, 'normalize') === true;
  }

  private distant(prim: StagePrim, index: number) {
    const half = number(prim, 'angle', 0.53) * Math.PI / 360;
    const solid = Math.PI * Math.sin(half) ** 2;
    const factor = this.normalized(prim) || solid === 0 ? 1 : solid;
    this.punctual(
        {type: 'directional', ...brightness(emission(prim), factor), name: prim.name}, index);
  }

  private point(prim: StagePrim, index: number, s: number[], cone: number) {
    const radius = number(prim, 'radius', 0.5) * s[0]!;
    // The area in square meters over pi; where it is a divisor or 0, that of a sphere of area 1.
    const part = this.normalized(prim) || radius === 0 ? 0.25 : Math.PI * radius * radius;
    const factor = part * this.metersPerUnit ** 2;
    const light = {...brightness(emission(prim), factor), name: prim.name};
    if (cone >= FULL_CONE) {
      this.punctual({type: 'point', ...light}, index);
      return;
    }
    const outer = Math.max(cone, 1e-3) * Math.PI / 180;
    const softness = Math.min(1, Math.max(0, number(prim, 'shaping:cone:softness', 0)));
    const inner = Math.min(outer * (1 - softness), outer * 0.999);
    this.punctual(
        {type: 'spot', ...light, spot: {innerConeAngle: inner, outerConeAngle: outer}}, index);
  }

  private area(prim: StagePrim, node: GltfNode, shape: Outline) {
    const factor = this.normalized(prim) ? 1 / (shape.area || 1) : 1;
    const {color, intensity} = brightness(emission(prim), factor);
    this.glb.extensions.add('KHR_materials_emissive_strength');
    const material = this.glb.materials.push({
      name: prim.name,
      pbrMetallicRoughness: {baseColorFactor: [0, 0, 0, 1], metallicFactor: 0, roughnessFactor: 1},
      emissiveFactor: color,
      extensions: {KHR_materials_emissive_strength: {emissiveStrength: intensity}},
    }) - 1;
    const position = this.glb.floats('VEC3', Float32Array.from(shape.points), true);
    const indices = this.glb.indices(Uint32Array.from(shape.faces));
    node.mesh = this.glb.meshes.push(
                    {primitives: [{attributes: {POSITION: position}, indices, material}]}) -
        1;
  }
}

// A color whose largest part is 1, and what it is to be multiplied by.
function brightness(radiance: number[], factor: number): {color: number[]; intensity: number} {
  const largest = Math.max(...radiance, 0);
  return {
    color: radiance.map(v => largest > 0 ? Math.max(0, v) / largest : 1),
    intensity: largest * factor
  };
}
