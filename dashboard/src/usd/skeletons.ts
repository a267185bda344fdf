// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// UsdSkel: skeletons, skins, their animations and blend shapes.

import type {Glb, GltfNode, JsonObject} from './glb';
import {isNumbers, isStrings} from './layer';
import type {Numbers, Samples} from './layer';
import {decompose, IDENTITY, inverse, multiply} from './matrix';
import type {Matrix} from './matrix';
import type {Note, Part} from './mesh';
import type {StagePrim} from './stage';

const JOINTS_A_VERTEX_MAX = 16;
const EPSILON = 1e-8;

// Seconds of time codes, from the stage's start.
export type Seconds = (times: number[]) => number[];

interface Skeleton {
  joints: string[];
  nodes: number[];
  bind: Matrix[];
}

const stringsOf = (prim: StagePrim, name: string): string[] => {
  const value = prim.value(name);
  return isStrings(value) ? value : [];
};

const matricesOf = (prim: StagePrim, name: string): Matrix[] => {
  const value = prim.value(name);
  if (!isNumbers(value)) return [];
  return Array.from(
      {length: Math.floor(value.length / 16)},
      (_, i) => Array.from(value.slice(i * 16, i * 16 + 16) as number[]));
};

// A relationship's target, of the prim or the nearest ancestor that has it.
function inheritedTarget(prim: StagePrim, name: string): StagePrim|undefined {
  for (let at: StagePrim|undefined = prim; at; at = at.parent) {
    const path = at.targets(name)[0];
    if (path !== undefined) return at.stage.prim(path);
  }
  return undefined;
}

export class Skeletons {
  private readonly known = new Map<string, Skeleton>();
  private readonly waiting: (() => void)[] = [];

  constructor(
      private readonly glb: Glb, private readonly seconds: Seconds, private readonly note: Note) {}

  // Adds a skeleton's joints below its node.
  add(prim: StagePrim, parent: number) {
    const joints = stringsOf(prim, 'joints');
    const rest = matricesOf(prim, 'restTransforms');
    const bind = matricesOf(prim, 'bindTransforms');
    const nodes: number[] = [];
    joints.forEach((joint, i) => {
      const owner = joints.indexOf(joint.slice(0, Math.max(0, joint.lastIndexOf('/'))));
      const {translation, rotation, scale} = decompose(rest[i] ?? localBind(joints, bind, i));
      nodes.push(this.glb.node({name: joint.split('/').at(-1), translation, rotation, scale}));
      const above = owner >= 0 && owner < i ? nodes[owner]! : parent;
      (this.glb.nodes[above]!.children ??= []).push(nodes[i]!);
    });
    this.known.set(prim.path, {joints, nodes, bind});
    const animation = inheritedTarget(prim, 'skel:animationSource');
    if (animation?.type === 'SkelAnimation') this.animate(animation, joints, nodes);
  }

  private animate(animation: StagePrim, joints: string[], nodes: number[]) {
    const names = stringsOf(animation, 'joints');
    const properties = [
      ['translations', 'translation', 3], ['rotations', 'rotation', 4], ['scales', 'scale', 3]
    ] as const;
    for (const [name, path, size] of properties) {
      const attribute = animation.attribute(name);
      const samples = attribute?.samples;
      const first = animation.value(name);
      if (!isNumbers(first)) continue;
      const times = samples && samples.times.length > 1 ? this.times(samples) : undefined;
      names.forEach((joint, i) => {
        const node = nodes[joints.indexOf(joint)];
        if (node === undefined || first.length < (i + 1) * size) return;
        this.glb.nodes[node]![path] =
            Array.from(first.slice(i * size, i * size + size) as number[]);
        if (times === undefined) return;
        const keys = new Float32Array(samples!.times.length * size);
        samples!.values.forEach((value, k) => {
          if (isNumbers(value))
            keys.set(value.slice(i * size, i * size + size) as Numbers, k * size);
        });
        this.glb.channel(node, path, times, size === 4 ? 'VEC4' : 'VEC3', keys);
      });
    }
  }

  private times(samples: Samples): number {
    return this.glb.floats('SCALAR', Float32Array.from(this.seconds(samples.times)), true);
  }

  // Joints and weights of a part's vertices; undefined if the mesh has no skin.
  attributes(prim: StagePrim, part: Part): JsonObject|undefined {
    const indices = prim.value('primvars:skel:jointIndices');
    const weights = prim.value('primvars:skel:jointWeights');
    const skeleton = inheritedTarget(prim, 'skel:skeleton');
    if (!isNumbers(indices) || !isNumbers(weights) || !skeleton) return undefined;
    const meta = prim.attribute('primvars:skel:jointIndices')!.meta;
    const isRigid = meta['interpolation'] === 'constant';
    const size = Number(meta['elementSize'] ?? 1);
    const used = Math.min(JOINTS_A_VERTEX_MAX, size);
    if (size > used) this.note('of the joints of a vertex 16 are used', prim.path);
    const order = stringsOf(prim, 'skel:joints');
    const all = stringsOf(skeleton, 'joints');
    const joint = (i: number) => Math.max(0, order.length > 0 ? all.indexOf(order[i] ?? '') : i);
    const count = part.pointOf.length;
    const result: JsonObject = {};
    for (let set = 0; set * 4 < used; set++) {
      const joints = new Uint16Array(count * 4);
      const parts = new Float32Array(count * 4);
      part.pointOf.forEach((point, vertex) => {
        const first = isRigid ? 0 : point * size;
        let sum = 0;
        for (let k = 0; k < used; k++) sum += weights[first + k] ?? 0;
        for (let k = set * 4; k < Math.min(used, set * 4 + 4); k++) {
          const weight = (weights[first + k] ?? 0) / (sum || 1);
          parts[vertex * 4 + k % 4] = weight;
          joints[vertex * 4 + k % 4] = weight > EPSILON ? joint(indices[first + k] ?? 0) : 0;
        }
        if (sum === 0 && set === 0) parts[vertex * 4] = 1;
      });
      result[`JOINTS_${set}`] = this.glb.joints(joints);
      result[`WEIGHTS_${set}`] = this.glb.floats('VEC4', parts);
    }
    return result;
  }

  // Gives a node its skin, once all skeletons are known.
  bind(prim: StagePrim, node: GltfNode) {
    const skeleton = inheritedTarget(prim, 'skel:skeleton');
    if (!skeleton) return;
    const value = prim.value('primvars:skel:geomBindTransform');
    const place =
        isNumbers(value) && value.length === 16 ? Array.from(value as number[]) : IDENTITY;
    this.waiting.push(() => {
      const known = this.known.get(skeleton.path);
      if (!known || known.nodes.length === 0) {
        this.note('skins of skeletons that are not shown are left out', prim.path);
        return;
      }
      const inverses =
          known.nodes.flatMap((_, i) => multiply(inverse(known.bind[i] ?? IDENTITY), place));
      node.skin = this.glb.skins.push({
        joints: known.nodes,
        inverseBindMatrices: this.glb.floats('MAT4', Float32Array.from(inverses)),
      }) - 1;
    });
  }

  finish() {
    for (const bind of this.waiting) bind();
  }

  // Blend shapes as morph targets of a part.
  targets(prim: StagePrim, part: Part): JsonObject[] {
    const paths = prim.targets('skel:blendShapeTargets');
    return paths.map(path => {
      const shape = prim.stage.prim(path);
      const offsets = shape?.value('offsets');
      const normals = shape?.value('normalOffsets');
      const points = shape?.value('pointIndices');
      const places = new Map<number, number>();
      if (isNumbers(points)) points.forEach((p: number, i: number) => places.set(p, i));
      const values = (data: Numbers) => {
        const result = new Float32Array(part.pointOf.length * 3);
        part.pointOf.forEach((point, vertex) => {
          const i = isNumbers(points) ? places.get(point) : point;
          if (i !== undefined)
            for (let k = 0; k < 3; k++) result[vertex * 3 + k] = data[i * 3 + k] ?? 0;
        });
        return this.glb.floats('VEC3', result, true);
      };
      const result: JsonObject = {POSITION: values(isNumbers(offsets) ? offsets : [])};
      if (isNumbers(normals) && normals.length > 0 && part.normals)
        result['NORMAL'] = values(normals);
      return result;
    });
  }

  // The weights of blend shapes: now, and as they move.
  weights(prim: StagePrim, node: number, mesh: JsonObject) {
    const names = stringsOf(prim, 'skel:blendShapes');
    const count = prim.targets('skel:blendShapeTargets').length;
    if (count === 0) return;
    const skeleton = inheritedTarget(prim, 'skel:skeleton');
    const animation = (skeleton && inheritedTarget(skeleton, 'skel:animationSource')) ??
        inheritedTarget(prim, 'skel:animationSource');
    const order = animation ? stringsOf(animation, 'blendShapes') : [];
    const attribute = animation?.attribute('blendShapeWeights');
    const pick = (value: unknown) => Array.from(
        {length: count},
        (_, i) => (value as number[] | undefined)?.[order.indexOf(names[i] ?? '')] ?? 0);
    mesh['weights'] = pick(animation?.value('blendShapeWeights'));
    const samples = attribute?.samples;
    if (!samples || samples.times.length < 2) return;
    this.glb.channel(
        node, 'weights', this.times(samples), 'SCALAR',
        Float32Array.from(samples.values.flatMap(pick)));
  }
}

function localBind(joints: string[], bind: Matrix[], i: number): Matrix {
  const joint = joints[i]!;
  const owner = joints.indexOf(joint.slice(0, Math.max(0, joint.lastIndexOf('/'))));
  const own = bind[i] ?? IDENTITY;
  return owner >= 0 ? multiply(inverse(bind[owner] ?? IDENTITY), own) : own;
}
