// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The shapes that USD knows without points: as polygons with smooth or sharp normals.

import type {Polygons, Primvar} from './mesh';
import type {StagePrim} from './stage';

const AROUND = 64;
const ALONG = 32;

// A surface of revolution about z: radius, height and the normal's radial and axial parts.
interface Ring {
  radius: number;
  z: number;
  nr: number;
  nz: number;
}

class Builder {
  readonly points: number[] = [];
  readonly normals: number[] = [];
  readonly counts: number[] = [];
  readonly indices: number[] = [];

  vertex(p: number[], n: number[]): number {
    this.points.push(...p);
    this.normals.push(...n);
    return this.points.length / 3 - 1;
  }

  face(...corners: number[]) {
    this.counts.push(corners.length);
    this.indices.push(...corners);
  }

  // Bands between rings whose z rises, seen from outside.
  revolve(rings: Ring[]) {
    const rows = rings.map(r => Array.from({length: AROUND + 1}, (_, i) => {
      const a = 2 * Math.PI * i / AROUND;
      return this.vertex(
          [r.radius * Math.cos(a), r.radius * Math.sin(a), r.z],
          [r.nr * Math.cos(a), r.nr * Math.sin(a), r.nz]);
    }));
    for (let r = 0; r + 1 < rows.length; r++) {
      for (let i = 0; i < AROUND; i++) {
        const [a, b] = [rows[r]!, rows[r + 1]!];
        if (rings[r]!.radius > 0) this.face(a[i]!, a[i + 1]!, b[i + 1]!);
        if (rings[r + 1]!.radius > 0) this.face(a[i]!, b[i + 1]!, b[i]!);
      }
    }
  }

  cap(radius: number, z: number, sign: number) {
    const inner = {radius: 0, z, nr: 0, nz: sign};
    const outer = {...inner, radius};
    this.revolve(sign < 0 ? [inner, outer] : [outer, inner]);
  }
}

function box(b: Builder, half: number) {
  for (let axis = 0; axis < 3; axis++) {
    for (const sign of [-1, 1]) {
      const [u, v] = sign > 0 ? [(axis + 1) % 3, (axis + 2) % 3] : [(axis + 2) % 3, (axis + 1) % 3];
      const n = [0, 0, 0];
      n[axis] = sign;
      b.face(...[[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([s, t]) => {
        const p = [0, 0, 0];
        p[axis] = sign * half;
        p[u!] = s! * half;
        p[v!] = t! * half;
        return b.vertex(p, n);
      }));
    }
  }
}

// A part of a circle's outline: rings by angles from -90 to 90 degrees.
function arc(radius: number, from: number, to: number, shift: number): Ring[] {
  return Array.from({length: ALONG + 1}, (_, i) => {
    const a = from + (to - from) * i / ALONG;
    const isPole = Math.abs(Math.cos(a)) < 1e-9;
    return {
      radius: isPole ? 0 : radius * Math.cos(a),
      z: radius * Math.sin(a) + shift,
      nr: Math.cos(a),
      nz: Math.sin(a)
    };
  });
}

function build(prim: StagePrim): Builder|undefined {
  const b = new Builder();
  const radius = prim.number('radius', prim.type === 'Capsule' ? 0.5 : 1);
  const height = prim.number('height', prim.type === 'Capsule' ? 1 : 2);
  const quarter = Math.PI / 2;
  switch (prim.type) {
    case 'Sphere':
      b.revolve(arc(radius, -quarter, quarter, 0));
      break;
    case 'Cube':
      box(b, prim.number('size', 2) / 2);
      break;
    case 'Cylinder':
      b.revolve([-1, 1].map(s => ({radius, z: s * height / 2, nr: 1, nz: 0})));
      b.cap(radius, -height / 2, -1);
      b.cap(radius, height / 2, 1);
      break;
    case 'Cone': {
      const slant = Math.hypot(radius, height);
      const [nr, nz] = [height / slant, radius / slant];
      b.revolve([{radius, z: -height / 2, nr, nz}, {radius: 0, z: height / 2, nr, nz}]);
      b.cap(radius, -height / 2, -1);
      break;
    }
    case 'Capsule':
      b.revolve([...arc(radius, -quarter, 0, -height / 2), ...arc(radius, 0, quarter, height / 2)]);
      break;
    case 'Plane': {
      const [w, l] = [prim.number('width', 2) / 2, prim.number('length', 2) / 2];
      b.face(...[[-w, -l], [w, -l], [w, l], [-w, l]].map(
          ([x, y]) => b.vertex([x!, y!, 0], [0, 0, 1])));
      break;
    }
    default:
      return undefined;
  }
  return b;
}

// Undefined: the prim is no such shape.
export function shapeOf(prim: StagePrim, color?: Primvar, opacity?: Primvar): Polygons|undefined {
  const b = build(prim);
  if (!b) return undefined;
  const axis = prim.string('axis') ?? 'Z';
  const hasAxis = prim.type !== 'Sphere' && prim.type !== 'Cube';
  // Built about z; a turn of the coordinates keeps the sides.
  const shift = !hasAxis || axis === 'Z' ? 0 : axis === 'X' ? 1 : 2;
  const turned = (list: number[]) =>
      Float64Array.from(list, (_, i) => list[i - i % 3 + (i % 3 - shift + 3) % 3]!);
  return {
    points: turned(b.points),
    counts: b.counts,
    indices: b.indices,
    isLeftHanded: prim.string('orientation') === 'leftHanded',
    holes: new Set(),
    uvs: new Map(),
    color,
    opacity,
    normals: {size: 3, data: turned(b.normals), interpolation: 'vertex'},
  };
}
