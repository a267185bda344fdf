// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What `sheaf study` writes as JSON (docs/study.md). Null is a number that is not known; what is
// missing is not known either, or empty.

export interface Point {
  // Of a pixel; on average where tiles differ.
  samples: number;
  // Of the whole picture.
  cpu_seconds: number|null;
  // Against the reference, and its standard error.
  relative_mse: number|null;
  relative_mse_error: number|null;
  // Whether no other point is both cheaper and nearer to the reference.
  on_front: boolean;
}

export interface Entry {
  name: string;
  // "depth 8, RGB, 16 sequences".
  how: string;
  // What chooses it on the command line: "--max-depth 4"; empty where nothing does.
  flag: string;
  is_base: boolean;
  // Whether its expectation is that of the base, whatever was measured.
  is_unbiased: boolean;
  points: Point[];
  // Exponent by which the variance falls with samples; 1 is plain Monte Carlo.
  rate: number|null;
  rate_error: number|null;
  // The error that is left however long one renders; null where the variance is not told.
  bias_floor: {relative_mse: number|null; error: number | null; is_significant: boolean}|null;
  // Time of the base over this entry's, to the error of this one's last point.
  gain: {value: number|null; error: number | null}|null;
}

export interface Effect {
  name: string;
  // How it was left out: "a pinhole".
  without: string;
  time_share: number|null;
  // CPU time and variance of a sample with the effect over one without.
  time_ratio: number|null;
  time_ratio_error: number|null;
  variance_ratio: number|null;
  // Of the picture's mean where the effect is left out, relative.
  mean_change: number|null;
  mean_change_error: number|null;
  rel_mse: number|null;
  // Why nothing was measured.
  problem: string|null;
}

export interface PathKind {
  name: string;
  meaning: string;
  light_share: number|null;
  noise_share: number|null;
  // Mean share of the kind's variance that one of the replicates makes alone.
  rare_share: number|null;
}

export interface Tile {
  x0: number;
  y0: number;
  x1: number;
  y1: number;
  path: string;
  // Of the tile's variance.
  share: number|null;
}

export interface Study {
  scene: string;
  width_px: number;
  height_px: number;
  pixels: number|null;
  seconds: number|null;
  threads: number|null;
  // Its own error is taken off from all others.
  reference: {samples: number|null; relative_mse: number | null; cpu_seconds: number | null}|null;
  entries: Entry[];
  effects: Effect[];
  paths: PathKind[];
  unreliable_tiles: Tile[];
  recommendation: string[];
  not_studied: string[];
}

const FORMAT = 1;

// The study that the page was made with. Throws where it is of another format.
export function readStudy(json: string): Study {
  const read = JSON.parse(json) as Partial<Study>& {format?: number};
  if (read.format !== FORMAT)
    throw new Error('this page shows format ' + FORMAT + ' of a study, not ' + read.format);
  return {
    scene: read.scene ?? '',
    width_px: read.width_px ?? 0,
    height_px: read.height_px ?? 0,
    pixels: read.pixels ?? null,
    seconds: read.seconds ?? null,
    threads: read.threads ?? null,
    reference: read.reference ?? null,
    entries: (read.entries ?? []).map((entry) => ({...entry, points: entry.points ?? []})),
    // One that was not measured has a name and a problem alone.
    effects: (read.effects ?? []).map((effect) => ({...effect, without: effect.without ?? ''})),
    paths: read.paths ?? [],
    unreliable_tiles: read.unreliable_tiles ?? [],
    recommendation: read.recommendation ?? [],
    not_studied: read.not_studied ?? [],
  };
}
