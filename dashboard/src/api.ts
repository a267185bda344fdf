// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The coordinator's HTTP API. Names go into paths segment by segment, escaped.

export interface Progress {
  sample_count_done: number;
  sample_count_total: number;
  // Null until it can be told.
  relative_mse: number|null;
  nonfinite_count: number;
  ray_count: number;
  cpu_duration_seconds: number;
  wall_duration_seconds: number;
  remaining_duration_seconds: number|null;
}

export interface Rect {
  x0_px: number;
  y0_px: number;
  x1_px: number;
  y1_px: number;
}

export interface Job {
  name: string;
  title: string;
  state: string;
  priority: number;
  failure: string;
  waiting_reason: string;
  // Leases that came to nothing.
  failure_count: number;
  create_time: string;
  end_time: string|null;
  frame_count: number;
  frame_complete_count: number;
  // That shows most life; null while there is nothing to see.
  pictured_frame: Pictured|null;
  progress: Progress;
}

// A frame of which there is a picture.
export interface Pictured {
  name: string;
  preview_version: number;
  complete: boolean;
}

export interface Round {
  relative_mse: number;
  sample_count: number;
  cpu_duration_seconds: number;
  wall_duration_seconds: number;
  // Of the picture as it was then; 0 where it is not kept.
  preview_version: number;
}

export interface Frame {
  name: string;
  frame_number: number;
  window: Rect;
  sample_count: number;
  complete: boolean;
  preview_version: number;
  // When the frame is to end; coordinators that know no such rule leave it out. The target is a
  // relative mean squared error, null for none.
  stop?: {target_error: number|null};
  // Digest of the EXR whose samples it began with, null for none.
  resumed_picture?: string|null;
  // How the frame stood at the end of each round, where it is rendered in rounds.
  rounds?: Round[];
  // Of a complete frame: tiles whose errors are not to be trusted, and the layers that make them so
  // (none where the frame has no layers); how different from the true picture it looks.
  tile_count?: number;
  unreliable_tile_count?: number;
  unreliable_layers?: {layer: string; tile_count: number}[];
  flip?: number|null;
  // Of a complete smooth frame: its relMSE over what it would be without true error bars.
  one_sequence_gain?: number|null;
  progress: Progress;
}

// A lease that came to nothing.
export interface Failure {
  frame_number: number;
  tile: Rect;
  first_sample: number;
  sample_count: number;
  worker: string;
  kind: string;
  message: string;
  time: string;
  // Renders the tile again on one machine.
  command: string;
}

// What a worker holds.
export interface Lease {
  frame_name: string;
  // Whether it is for a quote: such jobs are not listed.
  pilot: boolean;
  tile: Rect;
  phase: string;
}

export interface Worker {
  name: string;
  host: string;
  state: string;
  thread_count: number;
  numeric_profile: string;
  lease_count: number;
  // The first of them, what is rendered before what waits.
  leases: Lease[];
  warm_scene_count: number;
  // File names of some of them.
  warm_scenes: string[];
  // Null where it is not known.
  scene_memory_bytes: number|null;
  result_count: number;
  samples_per_second: number;
  last_seen_time: string|null;
  reason: string;
}

export interface Counter {
  name: string;
  help: string;
  label_value: string;
  value: number;
}

export interface WorkerPage {
  workers: Worker[];
  next_page_token: string;
}

export interface JobPage {
  jobs: Job[];
  next_page_token: string;
}

// What an effect of the scene costs and gives, with standard errors.
export interface EffectCost {
  name: string;
  // Why nothing was measured; else empty.
  problem: string;
  // How it was left out.
  without: string;
  // Of the processor time; below 0 where leaving it out costs time.
  time_share: number;
  time_share_error: number;
  // Of the picture's mean without it.
  mean_change: number;
  mean_change_error: number;
  relative_mse: number;
  // Of a sample with it over one without.
  variance_ratio: number;
}

// 8 of 10 lie between low and high.
export interface Estimate {
  value: number;
  low: number;
  high: number;
}

// What it costs to refine a job until its relMSE is at target_error, beyond what is there.
export interface RefinePrice {
  target_error: number;
  reached: boolean;
  relative_mse: Estimate;
  samples_per_pixel: Estimate;
  cpu_seconds: Estimate;
  // Null where no worker is there.
  wall_seconds: Estimate|null;
}

export interface RefinePrices {
  prices: RefinePrice[];
  thread_count: number;
  jobs_before_count: number;
}

export interface JobWithFrames extends Job {
  effect_costs: EffectCost[];
  frames: Frame[];
  next_page_token: string;
}

// Layers of a picture, as the coordinator names them: "light" is the picture before any exposure.
export type Layer = 'picture'|'light'|'error'|'samples'|'time';

// What the ends of false colours stand for; both are 0 where nothing can be told yet.
export interface LayerRange {
  low: number;
  high: number;
}

export interface Preview {
  bitmap: ImageBitmap;
  range: LayerRange|null;
}

// What the coordinator refused, with its words.
export class ApiError extends Error {
  constructor(message: string, readonly status: number) {
    super(message);
  }
}

const BASE = '/api/v1/';

const pathOf = (name: string) => BASE + name.split('/').map(encodeURIComponent).join('/');

async function errorOf(response: Response): Promise<ApiError> {
  let message = response.statusText || 'HTTP status ' + response.status;
  try {
    message = (await response.json()).error.message;
  } catch {
    // No answer of ours: the status is all that can be told.
  }
  return new ApiError(message, response.status);
}

async function request<Answer>(path: string, options: RequestInit = {}): Promise<Answer> {
  const response = await fetch(path, {cache: 'no-store', ...options});
  if (!response.ok) throw await errorOf(response);
  return await response.json() as Answer;
}

const query = (pageSize: number, token: string) =>
    '?page_size=' + pageSize + (token ? '&page_token=' + encodeURIComponent(token) : '');

export const listJobs = (pageSize: number, token: string) =>
    request<JobPage>(BASE + 'jobs' + query(pageSize, token));
export const getJob = (name: string, pageSize: number, token: string) =>
    request<JobWithFrames>(pathOf(name) + query(pageSize, token));
export const getFrame = (name: string) => request<Frame>(pathOf(name));
export const listFailures = (name: string) =>
    request<{failures: Failure[]}>(pathOf(name) + '/failures');
export const getRefinePrices = (name: string, targets: readonly number[]) =>
    request<RefinePrices>(pathOf(name) + '/refine-price?target_error=' + targets.join(','));
export const listWorkers = (pageSize: number, token: string) =>
    request<WorkerPage>(BASE + 'workers' + query(pageSize, token));
export const listCounters = () => request<{counters: Counter[]}>(BASE + 'counters');

// The header tells the coordinator that a page of its own asks, not one of another site.
const act = (name: string, action: string) =>
    request<Job>(pathOf(name) + action, {method: 'POST', headers: {'X-Sheaf-Request': '1'}});
export const cancelJob = (name: string) => act(name, ':cancel');
export const pauseJob = (name: string) => act(name, ':pause');
export const resumeJob = (name: string) => act(name, ':resume');
export const setPriority = (name: string, priority: number) =>
    act(name, ':priority?value=' + priority);
export const refineJob = (name: string, targetError: number) =>
    act(name, ':refine?target_error=' + targetError);

export const eventsPath = BASE + 'events';
export const falseColorPath = BASE + 'false-color.png';
// As it is now, or was at the end of a round.
export const previewPath = (frame: Frame, layer: Layer, round: number|null) => pathOf(frame.name) +
    '/preview.png?layer=' + layer +
    (round === null ? '&version=' + frame.preview_version :
                      '&round=' + round + '&version=' + frame.rounds?.[round]?.preview_version);
export const thumbnailPath = (frame: Pictured) =>
    pathOf(frame.name) + '/preview.png?size=thumbnail&version=' + frame.preview_version;
export const outputPath = (frame: Frame) => pathOf(frame.name) + '/output.exr';

// A picture so far; null where there is none yet. Its levels are as sent, whatever the screen is.
export async function getPreview(path: string): Promise<Preview|null> {
  const response = await fetch(path);
  if (!response.ok) throw await errorOf(response);
  if (response.status === 204) return null;
  const bitmap = await createImageBitmap(
      await response.blob(), {colorSpaceConversion: 'none', premultiplyAlpha: 'none'});
  const [low, high] = (response.headers.get('X-Sheaf-Range') ?? '').split(' ').map(Number);
  return {bitmap, range: low === undefined || high === undefined ? null : {low, high}};
}
