// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The transform of a prim: its xformOps in the order of xformOpOrder, at any time.

import {isNumbers, isStrings} from './layer';
import type {Numbers, Samples, Value} from './layer';
import {
  decompose,
  IDENTITY,
  inverse,
  multiply,
  ofQuaternion,
  rotationOf,
  scaleOf,
  translationOf
} from './matrix';
import type {Matrix, Trs} from './matrix';
import type {StagePrim} from './stage';

const DEGREES_PER_KEY = 30;
const KEYS_MAX = 100_000;
const INVERT = '!invert!';
const RESET = '!resetXformStack!';

interface Op {
  kind: string;
  isInverse: boolean;
  value?: Value;
  samples?: Samples;
}

export interface Animated {
  // In the stage's time codes.
  times: number[];
  keys: Trs[];
}

function slerp(a: Numbers, b: Numbers, t: number): number[] {
  let dot = 0;
  for (let i = 0; i < 4; i++) dot += a[i]! * b[i]!;
  const sign = dot < 0 ? -1 : 1;
  const angle = Math.acos(Math.min(1, Math.abs(dot)));
  const s = Math.sin(angle);
  const [u, v] = s < 1e-6 ? [1 - t, t] : [Math.sin((1 - t) * angle) / s, Math.sin(t * angle) / s];
  return [0, 1, 2, 3].map(i => u * a[i]! + sign * v * b[i]!);
}

// A value between samples, which USD interpolates linearly; quaternions by slerp.
export function valueAt(samples: Samples, time: number, isQuaternion = false): Value {
  const {times, values} = samples;
  let i = 0;
  while (i + 1 < times.length && times[i + 1]! <= time) i++;
  const a = values[i] ?? null;
  const b = values[i + 1];
  if (b === undefined || time <= times[i]!) return a;
  const t = (time - times[i]!) / (times[i + 1]! - times[i]!);
  if (typeof a === 'number' && typeof b === 'number') return a + (b - a) * t;
  if (!isNumbers(a) || !isNumbers(b) || a.length !== b.length) return a;
  if (!isQuaternion) return Array.from(a as number[], (v, j) => v + (b[j]! - v) * t);
  const result: number[] = [];
  for (let j = 0; j < a.length; j += 4)
    result.push(...slerp(a.slice(j, j + 4), b.slice(j, j + 4), t));
  return result;
}

function opMatrix(op: Op, time: number): Matrix {
  const value = op.samples ? valueAt(op.samples, time, op.kind === 'orient') : op.value ?? null;
  const v = isNumbers(value) ? value : typeof value === 'number' ? [value] : [];
  const [x, y, z] = [v[0] ?? 0, v[1] ?? 0, v[2] ?? 0];
  switch (op.kind) {
    case 'translate':
      return translationOf(x, y, z);
    case 'scale':
      return v.length === 3 ? scaleOf(x, y, z) : IDENTITY;
    case 'orient':
      return v.length === 4 ? ofQuaternion(Array.from(v as number[])) : IDENTITY;
    case 'transform':
      return v.length === 16 ? Array.from(v as number[]) : IDENTITY;
    default:
      break;
  }
  const axes = /^rotate([XYZ]{1,3})$/.exec(op.kind)?.[1] ?? '';
  if (axes.length === 1) return rotationOf('XYZ'.indexOf(axes), x);
  // The first axis turns first, and is the last factor.
  let result = IDENTITY;
  for (const axis of axes) {
    const i = 'XYZ'.indexOf(axis);
    result = multiply(rotationOf(i, v[i] ?? 0), result);
  }
  return result;
}

// How many keys the rotation between two samples needs to turn as in USD.
function keysBetween(op: Op, i: number): number {
  if (!op.kind.startsWith('rotate')) return 1;
  const [a, b] = [op.samples!.values[i], op.samples!.values[i + 1]];
  const list = (v: Value|undefined) => isNumbers(v) ? Array.from(v as number[]) : [Number(v) || 0];
  const [from, to] = [list(a), list(b)];
  return Math.ceil(
      Math.max(1, ...from.map((v, j) => Math.abs((to[j] ?? 0) - v) / DEGREES_PER_KEY)));
}

export class Transform {
  readonly resets: boolean;
  private readonly ops: Op[] = [];

  constructor(prim: StagePrim) {
    const order = prim.value('xformOpOrder');
    const names = isStrings(order) ? order : [];
    this.resets = names.includes(RESET);
    for (const name of names.slice(names.lastIndexOf(RESET) + 1)) {
      const isInverse = name.startsWith(INVERT);
      const attribute = isInverse ? name.slice(INVERT.length) : name;
      const found = prim.attribute(attribute);
      if (!found) continue;
      const kind = attribute.split(':')[1] ?? '';
      this.ops.push({kind, isInverse, value: found.value, samples: found.samples});
    }
  }

  at(time: number): Matrix {
    let result = IDENTITY;
    for (const op of this.ops) {
      const matrix = opMatrix(op, time);
      result = multiply(result, op.isInverse ? inverse(matrix) : matrix);
    }
    return result;
  }

  // Keys wherever an op has a sample; undefined if nothing moves.
  animated(): Animated|undefined {
    const set = new Set<number>();
    for (const op of this.ops) {
      const times = op.samples?.times ?? [];
      if (times.length < 2) continue;
      times.forEach((time, i) => {
        const next = times[i + 1];
        set.add(time);
        if (next === undefined || set.size > KEYS_MAX) return;
        const steps = keysBetween(op, i);
        for (let s = 1; s < steps; s++) set.add(time + (next - time) * s / steps);
      });
    }
    if (set.size < 2) return undefined;
    const times = [...set].sort((a, b) => a - b);
    return {times, keys: times.map(time => decompose(this.at(time)))};
  }
}
