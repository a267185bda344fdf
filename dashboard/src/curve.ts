// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The error of a job or frame over its samples, and the power law that fits it: a straight line on
// logarithmic axes. Views depend only on CurveSource, not on the origin of the points.

import type {Progress, Round} from './api';

export interface CurvePoint {
  sampleCount: number;
  relativeMse: number;
  cpuSeconds: number;
  wallSeconds: number;
}

export interface CurveSource {
  // By ascending sampleCount.
  readonly points: readonly CurvePoint[];
}

// Maximum number of points; beyond it every other point of the older half is dropped.
const CURVE_POINTS_MAX = 1024;

// Collects points from the progress of a job while the page is open.
export class WatchedCurve implements CurveSource {
  points: CurvePoint[] = [];

  add(progress: Progress) {
    const last = this.points.at(-1);
    if (!progress.relative_mse || progress.sample_count_done <= (last?.sampleCount ?? 0)) return;
    this.points.push({
      sampleCount: progress.sample_count_done,
      relativeMse: progress.relative_mse,
      cpuSeconds: progress.cpu_duration_seconds,
      wallSeconds: progress.wall_duration_seconds,
    });
    if (this.points.length <= CURVE_POINTS_MAX) return;
    const half = CURVE_POINTS_MAX / 2;
    this.points = this.points.filter((_, i) => i >= half || i % 2 === 0);
  }
}

// The curve that the coordinator recorded for a frame.
export function curveOfRounds(rounds: readonly Round[]): CurveSource {
  const points =
      rounds.filter((round) => round.relative_mse > 0).map((round) => ({
                                                             sampleCount: round.sample_count,
                                                             relativeMse: round.relative_mse,
                                                             cpuSeconds: round.cpu_duration_seconds,
                                                             wallSeconds:
                                                                 round.wall_duration_seconds,
                                                           }));
  return {points};
}

// y = y0 * (x / x0)^exponent. The law is centered on one of the fitted points: x^exponent alone
// could overflow for a steep line.
export interface PowerLaw {
  x0: number;
  y0: number;
  exponent: number;
}

// The least-squares line through (log x, log y); null if it is undetermined. Requires: all numbers
// are above 0.
export function fitPowerLaw(points: readonly(readonly[number, number])[]): PowerLaw|null {
  const logs = points.map(([x, y]): [number, number] => [Math.log(x), Math.log(y)]);
  const meanX = logs.reduce((sum, [x]) => sum + x, 0) / logs.length;
  const meanY = logs.reduce((sum, [, y]) => sum + y, 0) / logs.length;
  const varianceX = logs.reduce((sum, [x]) => sum + (x - meanX) ** 2, 0);
  if (!(varianceX > 0)) return null;
  const covariance = logs.reduce((sum, [x, y]) => sum + (x - meanX) * (y - meanY), 0);
  return {x0: Math.exp(meanX), y0: Math.exp(meanY), exponent: covariance / varianceX};
}
