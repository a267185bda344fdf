// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Meshes: polygons, primvars and subsets to triangles with attributes at their vertices.

import {isNumbers} from './layer';
import type {Numbers} from './layer';
import type {StagePrim} from './stage';
import {polygonNormal, triangulate} from './triangles';

export type Note = (kind: string, place: string) => void;

// A primvar: `size` numbers at each of its elements, and which element a corner has.
export interface Primvar {
  size: number;
  data: Numbers;
  interpolation: string;
  indices?: Numbers;
}

export interface Polygons {
  points: Numbers;
  counts: Numbers;
  indices: Numbers;
  isLeftHanded: boolean;
  holes: Set<number>;
  normals?: Primvar;
  // By name: texture coordinates, two numbers each.
  uvs: Map<string, Primvar>;
  color?: Primvar;
  opacity?: Primvar;
}

// A part of a mesh with one material: arrays by vertex, and where each vertex comes from.
export interface Part {
  indices: Uint32Array;
  positions: Float32Array;
  normals?: Float32Array;
  uvs: Map<string, Float32Array>;
  colors?: Float32Array;
  // The point of each vertex, by which skins and blend shapes find theirs.
  pointOf: Uint32Array;
}

// A primvar by its name, from the prim itself or (for displayColor and such) an ancestor.
export function primvar(prim: StagePrim, name: string, size: number): Primvar|undefined {
  const attribute = prim.attribute(name);
  const data = prim.value(name);
  if (!attribute || !isNumbers(data) || data.length === 0 || data.length % size !== 0) {
    return undefined;
  }
  const interpolation = String(attribute.meta['interpolation'] ?? 'constant');
  const indices = prim.value(name + ':indices');
  return {size, data, interpolation, indices: isNumbers(indices) ? indices : undefined};
}

function uvPrimvars(prim: StagePrim): Map<string, Primvar> {
  const result = new Map<string, Primvar>();
  for (const full of prim.names) {
    if (!full.startsWith('primvars:') || full.endsWith(':indices')) continue;
    const name = full.slice('primvars:'.length);
    if (name.startsWith('skel:') || name.startsWith('display') || name === 'normals') continue;
    const found = primvar(prim, full, 2);
    // Its type is not kept, so its length tells whether it has two numbers at each element.
    if (found && fits(found, prim)) result.set(name, found);
  }
  return result;
}

function fits(found: Primvar, prim: StagePrim): boolean {
  if (found.indices) {
    let largest = 0;
    for (const i of found.indices) largest = Math.max(largest, i);
    return found.data.length / 2 > largest && found.data.length >= 6;
  }
  const size = (name: string) => {
    const value = prim.value(name);
    return isNumbers(value) ? value.length : 0;
  };
  if (found.interpolation === 'faceVarying')
    return found.data.length === size('faceVertexIndices') * 2;
  if (found.interpolation === 'vertex' || found.interpolation === 'varying') {
    return found.data.length * 3 === size('points') * 2;
  }
  return false;
}

// Undefined, with a note, if there is nothing to show.
export function readPolygons(prim: StagePrim, note: Note): Polygons|undefined {
  const [points, counts, indices] =
      ['points', 'faceVertexCounts', 'faceVertexIndices'].map(name => prim.value(name));
  if (!isNumbers(points) || !isNumbers(counts) || !isNumbers(indices) || counts.length === 0) {
    note('meshes without points or faces are left out', prim.path);
    return undefined;
  }
  let corners = 0;
  for (const count of counts) corners += count;
  let largest = 0;
  for (const i of indices) largest = Math.max(largest, i < 0 ? Infinity : i);
  if (corners > indices.length || largest * 3 + 2 >= points.length) {
    note('meshes whose faces name points that are not there are left out', prim.path);
    return undefined;
  }
  if (prim.attribute('points')?.samples?.values[1] !== undefined) {
    note('points that move stay where they are at first', prim.path);
  }
  const scheme = prim.string('subdivisionScheme') ?? 'catmullClark';
  if (scheme !== 'none') {
    note('subdivision surfaces are shown by their control meshes, with smooth normals', prim.path);
  }
  const holes = prim.value('holeIndices');
  let normals = primvar(prim, 'primvars:normals', 3) ?? primvar(prim, 'normals', 3);
  if (normals && normals.interpolation === 'constant')
    normals = {...normals, interpolation: 'vertex'};
  const isLeftHanded = prim.string('orientation') === 'leftHanded';
  if (!normals && scheme !== 'none') normals = smoothNormals(points, counts, indices, isLeftHanded);
  return {
    points,
    counts,
    indices,
    normals,
    isLeftHanded,
    holes: new Set(isNumbers(holes) ? Array.from(holes as number[]) : []),
    uvs: uvPrimvars(prim),
    color: inherited(prim, 'primvars:displayColor', 3),
    opacity: inherited(prim, 'primvars:displayOpacity', 1),
  };
}

// Constant primvars hold for descendants too.
function inherited(prim: StagePrim, name: string, size: number): Primvar|undefined {
  for (let at: StagePrim|undefined = prim; at; at = at.parent) {
    const found = primvar(at, name, size);
    if (found && (at === prim || found.interpolation === 'constant')) return found;
  }
  return undefined;
}

// Sets of faces with materials of their own; the rest are under the empty path.
export function subsets(prim: StagePrim, faces: number): Map<StagePrim, number[]> {
  const result = new Map<StagePrim, number[]>();
  const rest = new Set<number>();
  for (let i = 0; i < faces; i++) rest.add(i);
  for (const child of prim.children) {
    if (child.type !== 'GeomSubset') continue;
    const family = child.string('familyName');
    if (family !== undefined && family !== 'materialBind' &&
        child.targets('material:binding').length === 0)
      continue;
    const indices = child.value('indices');
    if (!isNumbers(indices) || child.targets('material:binding').length === 0) continue;
    const list = Array.from(indices as number[]).filter(i => rest.delete(i));
    if (list.length > 0) result.set(child, list);
  }
  if (rest.size > 0) result.set(prim, [...rest]);
  return result;
}

function elementOf(p: Primvar, point: number, corner: number, face: number): number {
  const i = p.interpolation === 'faceVarying' ? corner :
      p.interpolation === 'uniform'           ? face :
      p.interpolation === 'constant'          ? 0 :
                                                point;
  return p.indices ? p.indices[i] ?? 0 : i;
}

// Normals of points, by the areas of their faces.
function smoothNormals(
    points: Numbers, counts: Numbers, indices: Numbers, isLeftHanded: boolean): Primvar {
  const data = new Float32Array(points.length);
  const sign = isLeftHanded ? -1 : 1;
  let at = 0;
  for (const count of counts) {
    const corners = Array.from(indices.slice(at, at + count) as number[]);
    const n = polygonNormal(points, corners);
    for (const c of corners)
      for (let k = 0; k < 3; k++) data[c * 3 + k]! += n[k]! * sign;
    at += count;
  }
  return {size: 3, data, interpolation: 'vertex'};
}

// Vertices are shared where all of their elements are.
class Vertices {
  readonly positions: number[] = [];
  readonly pointOf: number[] = [];
  readonly corners: {point: number; corner: number; face: number}[] = [];
  private readonly known = new Map<string|number, number>();

  constructor(private readonly mesh: Polygons, private readonly primvars: Primvar[]) {}

  add(point: number, corner: number, face: number): number {
    const key = this.primvars.length === 0 ?
        point :
        point + ',' + this.primvars.map(p => elementOf(p, point, corner, face)).join();
    let index = this.known.get(key);
    if (index === undefined) {
      index = this.pointOf.push(point) - 1;
      this.known.set(key, index);
      this.corners.push({point, corner, face});
      for (let k = 0; k < 3; k++) this.positions.push(this.mesh.points[point * 3 + k]!);
    }
    return index;
  }

  values(p: Primvar): Float32Array {
    const result = new Float32Array(this.pointOf.length * p.size);
    this.corners.forEach(({point, corner, face}, i) => {
      const element = elementOf(p, point, corner, face);
      for (let k = 0; k < p.size; k++) result[i * p.size + k] = p.data[element * p.size + k] ?? 0;
    });
    return result;
  }
}

function normalize(normals: Float32Array): Float32Array {
  for (let i = 0; i < normals.length; i += 3) {
    const length = Math.hypot(normals[i]!, normals[i + 1]!, normals[i + 2]!);
    if (!(length > 0))
      normals.set([0, 0, 1], i);
    else
      for (let k = 0; k < 3; k++) normals[i + k]! /= length;
  }
  return normals;
}

// The triangles of some faces; undefined if there are none.
export function partOf(mesh: Polygons, faces: number[], firstCorners: Uint32Array): Part|undefined {
  const {normals} = mesh;
  const flips = mesh.isLeftHanded;
  const varying =
      [normals, mesh.color, mesh.opacity, ...mesh.uvs.values()]
          .filter(p => p !== undefined)
          .filter(
              p => p.interpolation !== 'constant' &&
                  (p.indices || (p.interpolation !== 'vertex' && p.interpolation !== 'varying')));
  const vertices = new Vertices(mesh, varying);
  const indices: number[] = [];
  for (const face of faces) {
    const count = mesh.counts[face];
    if (count === undefined || count < 3 || mesh.holes.has(face)) continue;
    const first = firstCorners[face]!;
    const corners = Array.from(mesh.indices.slice(first, first + count) as number[]);
    const triangles = triangulate(mesh.points, corners);
    if (flips) triangles.reverse();
    for (const t of triangles) indices.push(vertices.add(corners[t]!, first + t, face));
  }
  if (indices.length === 0) return undefined;
  const part: Part = {
    indices: Uint32Array.from(indices),
    positions: Float32Array.from(vertices.positions),
    pointOf: Uint32Array.from(vertices.pointOf),
    uvs: new Map(),
  };
  if (normals) part.normals = normalize(vertices.values(normals));
  for (const [name, uv] of mesh.uvs) {
    const values = vertices.values(uv);
    for (let i = 1; i < values.length; i += 2) values[i] = 1 - values[i]!;
    part.uvs.set(name, values);
  }
  part.colors = colorsOf(mesh, vertices);
  return part;
}

function colorsOf(mesh: Polygons, vertices: Vertices): Float32Array|undefined {
  if (!mesh.color && !mesh.opacity) return undefined;
  const result = new Float32Array(vertices.pointOf.length * 4).fill(1);
  const put = (p: Primvar|undefined, at: number) => {
    if (!p) return;
    vertices.values(p).forEach((v, i) => {
      result[Math.floor(i / p.size) * 4 + at + i % p.size] = Math.min(1, Math.max(0, v));
    });
  };
  if (!mesh.color)
    for (let i = 0; i < result.length; i += 4) result.fill(0.18, i, i + 3);
  put(mesh.color, 0);
  put(mesh.opacity, 3);
  return result;
}

// Where the corners of each face begin.
export function firstCorners(counts: Numbers): Uint32Array {
  const result = new Uint32Array(counts.length);
  let at = 0;
  counts.forEach((count: number, face: number) => {
    result[face] = at;
    at += count;
  });
  return result;
}
