// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Matrices of 16 numbers: rows of USD, which are columns of glTF.

export type Matrix = number[];
export type Vector = [number, number, number];
// x, y, z, w.
export type Quaternion = [number, number, number, number];

export interface Trs {
  translation: Vector;
  rotation: Quaternion;
  scale: Vector;
}

export const IDENTITY: Matrix = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

// The matrix that applies `b`, then `a`.
export function multiply(a: Matrix, b: Matrix): Matrix {
  const result: Matrix = [];
  for (let column = 0; column < 4; column++) {
    for (let row = 0; row < 4; row++) {
      let sum = 0;
      for (let i = 0; i < 4; i++) sum += a[i * 4 + row]! * b[column * 4 + i]!;
      result.push(sum);
    }
  }
  return result;
}

export function translationOf(x: number, y: number, z: number): Matrix {
  return [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1];
}

export function scaleOf(x: number, y: number, z: number): Matrix {
  return [x, 0, 0, 0, 0, y, 0, 0, 0, 0, z, 0, 0, 0, 0, 1];
}

// A rotation about an axis (0, 1, 2) by degrees.
export function rotationOf(axis: number, degrees: number): Matrix {
  const angle = degrees * Math.PI / 180;
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const result = [...IDENTITY];
  const [i, j] = [(axis + 1) % 3, (axis + 2) % 3];
  result[i * 4 + i] = c;
  result[i * 4 + j] = s;
  result[j * 4 + i] = -s;
  result[j * 4 + j] = c;
  return result;
}

export function ofQuaternion(q: number[]): Matrix {
  const length = Math.hypot(q[0]!, q[1]!, q[2]!, q[3]!) || 1;
  const [x, y, z, w] = q.map(v => v / length) as Quaternion;
  return [
    1 - 2 * (y * y + z * z),
    2 * (x * y + z * w),
    2 * (x * z - y * w),
    0,
    2 * (x * y - z * w),
    1 - 2 * (x * x + z * z),
    2 * (y * z + x * w),
    0,
    2 * (x * z + y * w),
    2 * (y * z - x * w),
    1 - 2 * (x * x + y * y),
    0,
    0,
    0,
    0,
    1,
  ];
}

export function determinant(m: Matrix): number {
  return m[0]! * (m[5]! * m[10]! - m[6]! * m[9]!) - m[4]! * (m[1]! * m[10]! - m[2]! * m[9]!) +
      m[8]! * (m[1]! * m[6]! - m[2]! * m[5]!);
}

// The inverse of an affine matrix; the identity where there is none.
export function inverse(m: Matrix): Matrix {
  const d = determinant(m);
  if (!Number.isFinite(1 / d)) return IDENTITY;
  const at = (column: number, row: number) => m[column * 4 + row]!;
  const result = [...IDENTITY];
  for (let c = 0; c < 3; c++) {
    for (let r = 0; r < 3; r++) {
      const [c1, c2, r1, r2] = [(c + 1) % 3, (c + 2) % 3, (r + 1) % 3, (r + 2) % 3];
      result[r * 4 + c] = (at(c1, r1) * at(c2, r2) - at(c1, r2) * at(c2, r1)) / d;
    }
  }
  for (let r = 0; r < 3; r++) {
    result[12 + r] = -(result[r]! * m[12]! + result[4 + r]! * m[13]! + result[8 + r]! * m[14]!);
  }
  return result;
}

function quaternionOf(m: Matrix): Quaternion {
  const [a, b, c] = [m[0]!, m[5]!, m[10]!];
  if (a + b + c > 0) {
    const s = Math.sqrt(a + b + c + 1) * 2;
    return [(m[6]! - m[9]!) / s, (m[8]! - m[2]!) / s, (m[1]! - m[4]!) / s, s / 4];
  }
  if (a > b && a > c) {
    const s = Math.sqrt(1 + a - b - c) * 2;
    return [s / 4, (m[4]! + m[1]!) / s, (m[8]! + m[2]!) / s, (m[6]! - m[9]!) / s];
  }
  if (b > c) {
    const s = Math.sqrt(1 + b - a - c) * 2;
    return [(m[4]! + m[1]!) / s, s / 4, (m[9]! + m[6]!) / s, (m[8]! - m[2]!) / s];
  }
  const s = Math.sqrt(1 + c - a - b) * 2;
  return [(m[8]! + m[2]!) / s, (m[9]! + m[6]!) / s, s / 4, (m[1]! - m[4]!) / s];
}

// Translation, rotation and scale; shear is lost, which `isSheared` tells.
export function decompose(m: Matrix): Trs&{isSheared: boolean} {
  const length = (i: number) => Math.hypot(m[i * 4]!, m[i * 4 + 1]!, m[i * 4 + 2]!);
  const scale: Vector = [length(0), length(1), length(2)];
  if (determinant(m) < 0) scale[0] = -scale[0];
  const turn = [...m];
  for (let i = 0; i < 3; i++)
    for (let j = 0; j < 3; j++) turn[i * 4 + j]! /= scale[i]! || 1;
  const dot = (i: number, j: number) => Math.abs(
      turn[i * 4]! * turn[j * 4]! + turn[i * 4 + 1]! * turn[j * 4 + 1]! +
      turn[i * 4 + 2]! * turn[j * 4 + 2]!);
  return {
    translation: [m[12]!, m[13]!, m[14]!],
    rotation: quaternionOf(turn),
    scale,
    isSheared: Math.max(dot(0, 1), dot(0, 2), dot(1, 2)) > 1e-4,
  };
}

export function transformPoint(m: Matrix, x: number, y: number, z: number): Vector {
  return [0, 1, 2].map(i => m[i]! * x + m[4 + i]! * y + m[8 + i]! * z + m[12 + i]!) as Vector;
}
