// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The JSON that `sheaf study` writes (docs/study.md). Null is an unknown number; a missing member
// is unknown or empty.

export interface Point {
  // Per pixel; the mean if tiles differ.
  samples: number;
  // For the whole image.
  cpu_seconds: number|null;
  // Against the reference, with its standard error.
  relative_mse: number|null;
  relative_mse_error: number|null;
  // Whether no point of a setting that renders the same image has both a lower cost and a smaller
  // error.
  on_pareto_front: boolean;
}

export interface Entry {
  name: string;
  // "depth 8, RGB, 16 sequences".
  how: string;
  // The command-line option that selects it: "--max-depth 4"; empty if there is none.
  flag: string;
  is_base: boolean;
  // Whether it has the same expected value as the base, independent of the measurement.
  is_unbiased: boolean;
  // False if it gives up the true error bars of the base.
  keeps_error_bars: boolean;
  points: Point[];
  // Exponent with which the variance falls with the number of samples; 1 is plain Monte Carlo.
  rate: number|null;
  rate_error: number|null;
  // The error that remains for any number of samples; null if the variance is unknown.
  bias_floor: {relative_mse: number|null; error: number | null; is_significant: boolean}|null;
  // CPU time of the base over this entry's time to reach the error of this entry's last point.
  gain: {value: number|null; error: number | null}|null;
}

export interface Effect {
  name: string;
  // The ablation: "a pinhole".
  ablation: string;
  time_fraction: number|null;
  // CPU time and variance per sample with the effect over those without.
  time_ratio: number|null;
  time_ratio_error: number|null;
  variance_ratio: number|null;
  // Relative change of the image's mean without the effect.
  mean_change: number|null;
  mean_change_error: number|null;
  relative_mse: number|null;
  // Why nothing was measured.
  problem: string|null;
}

export interface PathKind {
  name: string;
  meaning: string;
  light_fraction: number|null;
  noise_fraction: number|null;
  // Mean fraction of the kind's variance that comes from a single replicate.
  largest_replicate_fraction: number|null;
}

export interface Tile {
  x0: number;
  y0: number;
  x1: number;
  y1: number;
  path: string;
  // Fraction of the tile's variance.
  fraction: number|null;
}

// The whole image at a number of samples per pixel.
export interface Price {
  samples: number;
  cpu_seconds: number|null;
  relative_mse: number|null;
  relative_mse_error: number|null;
}

export interface CropImage {
  // The error of the crop alone, estimated from its replicates.
  relative_mse: number|null;
  png_base64: string;
}

// A region of the image at each of the prices, in their order.
export interface Crop {
  // "largest error" or "representative".
  kind: string;
  x0: number;
  y0: number;
  x1: number;
  y1: number;
  images: CropImage[];
}

// The farm that was named. It rendered nothing for the study.
export interface StudyFarm {
  address: string;
  worker_count: number;
  thread_count: number;
  // Unfinished jobs, which times leave out.
  other_job_count: number;
}

// The figures that a study measures in another way if the frame has light paths. A light pass is
// one light path for each pixel of the whole frame.
export interface StudyLight {
  // How many times smaller than the image the frame of light passes is; 1: it is the image's own.
  shrink: number;
  width_px: number;
  height_px: number;
  // The same for kinds of paths.
  paths_shrink: number;
  // The most light passes of the image itself, which the reference and the crops show.
  reference_passes: number;
  // The part of cpu_seconds_per_sample for a light pass.
  cpu_seconds_per_pass: number|null;
}

export interface Study {
  scene: string;
  width_px: number;
  height_px: number;
  pixels: number|null;
  seconds: number|null;
  threads: number|null;
  // The time of the base, for one sample of every pixel.
  cpu_seconds_per_sample: number|null;
  // Before the first sample of a guided frame.
  training_cpu_seconds: number|null;
  // Null if paths begin at the camera alone.
  light: StudyLight|null;
  // The fraction of threads' time that goes into samples.
  thread_use: number;
  farm: StudyFarm|null;
  prices: Price[];
  crops: Crop[];
  // Its own error is subtracted from all others.
  reference: {samples: number|null; relative_mse: number | null; cpu_seconds: number | null}|null;
  entries: Entry[];
  effects: Effect[];
  paths: PathKind[];
  // Tiles whose reliability is known.
  assessed_tile_count: number;
  unreliable_tiles: Tile[];
  recommendation: string[];
  not_studied: string[];
}

const FORMAT = 2;

// The study that the page contains. Throws if its format is unknown.
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
    cpu_seconds_per_sample: read.cpu_seconds_per_sample ?? null,
    training_cpu_seconds: read.training_cpu_seconds ?? null,
    light: read.light ?? null,
    thread_use: read.thread_use ?? 1,
    farm: read.farm ?? null,
    prices: read.prices ?? [],
    crops: read.crops ?? [],
    reference: read.reference ?? null,
    entries: (read.entries ?? []).map((entry) => ({
                                        ...entry,
                                        points: entry.points ?? [],
                                        keeps_error_bars: entry.keeps_error_bars ?? true,
                                      })),
    // An effect that was not measured has only a name and a problem.
    effects: (read.effects ?? []).map((effect) => ({...effect, ablation: effect.ablation ?? ''})),
    paths: read.paths ?? [],
    assessed_tile_count: read.assessed_tile_count ?? 0,
    unreliable_tiles: read.unreliable_tiles ?? [],
    recommendation: read.recommendation ?? [],
    not_studied: read.not_studied ?? [],
  };
}
