// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Triangles of polygons: fans where a polygon is convex, else ears.

import type {Numbers} from './layer';
import type {Vector} from './matrix';

// The normal of a polygon, as long as twice its area.
export function polygonNormal(points: Numbers, corners: number[]): Vector {
  const n: Vector = [0, 0, 0];
  corners.forEach((a, i) => {
    const b = corners[(i + 1) % corners.length]!;
    const at = (p: number, k: number) => points[p * 3 + k]!;
    for (let k = 0; k < 3; k++) {
      const [u, v] = [(k + 1) % 3, (k + 2) % 3];
      n[k]! += (at(a, u) - at(b, u)) * (at(a, v) + at(b, v));
    }
  });
  return n;
}

// Corners of triangles, as places (0, 1, ...) in the polygon.
export function triangulate(points: Numbers, corners: number[]): number[] {
  const count = corners.length;
  if (count === 3) return [0, 1, 2];
  const n = polygonNormal(points, corners);
  const axis = [0, 1, 2].reduce((best, k) => Math.abs(n[k]!) > Math.abs(n[best]!) ? k : best, 0);
  const sign = n[axis]! < 0 ? -1 : 1;
  const [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
  const x = corners.map(c => points[c * 3 + u]! * sign);
  const y = corners.map(c => points[c * 3 + v]!);
  const turn = (a: number, b: number, c: number) =>
      (x[b]! - x[a]!) * (y[c]! - y[a]!) - (y[b]! - y[a]!) * (x[c]! - x[a]!);
  const rest = corners.map((_, i) => i);
  const result: number[] = [];
  const isConvex = rest.every(i => turn((i + count - 1) % count, i, (i + 1) % count) >= 0);
  if (isConvex) {
    for (let i = 1; i + 1 < count; i++) result.push(0, i, i + 1);
    return result;
  }
  const isEar = (i: number) => {
    const [a, b, c] =
        [rest[(i + rest.length - 1) % rest.length]!, rest[i]!, rest[(i + 1) % rest.length]!];
    if (turn(a, b, c) <= 0) return false;
    return !rest.some(
        p => p !== a && p !== b && p !== c && turn(a, b, p) >= 0 && turn(b, c, p) >= 0 &&
            turn(c, a, p) >= 0);
  };
  while (rest.length > 3) {
    let ear = rest.findIndex((_, i) => isEar(i));
    if (ear < 0) ear = 0;
    result.push(
        rest[(ear + rest.length - 1) % rest.length]!, rest[ear]!, rest[(ear + 1) % rest.length]!);
    rest.splice(ear, 1);
  }
  result.push(...rest);
  return result;
}
