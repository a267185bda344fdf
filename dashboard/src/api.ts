// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The coordinator's HTTP API. Names become path segments, each escaped.

export interface Progress {
  // Pixel samples; each light path counts as one, too.
  sample_count_done: number;
  sample_count_total: number;
  // Null while unknown.
  relative_mse: number|null;
  nonfinite_count: number;
  ray_count: number;
  cpu_duration_seconds: number;
  wall_duration_seconds: number;
  remaining_duration_seconds: number|null;
  // The band that holds in 8 of 10 cases, and the time if no other job shared the farm.
  remaining_duration_low_seconds: number|null;
  remaining_duration_high_seconds: number|null;
  remaining_duration_alone_seconds: number|null;
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
  // The user and the show; missing from coordinators without them.
  owner?: string;
  show?: string;
  state: string;
  priority: number;
  failure: string;
  waiting_reason: string;
  // A warning about its images; mostly empty.
  warning?: string;
  // Number of failed leases.
  failure_count: number;
  // Nothing that is kept of it is removed to keep the coordinator's disk free.
  pinned?: boolean;
  // When its parts were; null if they were not.
  parts_removed_time?: string|null;
  create_time: string;
  end_time: string|null;
  frame_count: number;
  frame_complete_count: number;
  // Frames that have ended without an image; missing from coordinators without failure classes.
  incomplete_frame_count?: number;
  // Frames that wait for approval after a first pass; missing from coordinators without it.
  unapproved_frame_count?: number;
  // The most active frame; null if no frame has an image yet.
  preview_frame: PreviewFrame|null;
  progress: Progress;
}

// How often a worker failed a task by a class; the worker is empty where it vanished.
export interface TaskFailure {
  kind: string;
  worker: string;
  count: number;
  message: string;
}

// A task that is set aside.
export interface SetAsideTask {
  task: number;
  why: string;
  // None if a user set it aside.
  failures: TaskFailure[];
}

// A frame that has an image.
export interface PreviewFrame {
  name: string;
  preview_version: number;
  complete: boolean;
}

export interface Round {
  relative_mse: number;
  // Those of the camera alone.
  sample_count: number;
  cpu_duration_seconds: number;
  wall_duration_seconds: number;
  // Version of the image at that time; 0 if it is not stored.
  preview_version: number;
}

export interface Frame {
  name: string;
  frame_number: number;
  window: Rect;
  sample_count: number;
  complete: boolean;
  // Why it has ended without an image; missing from coordinators without failure classes.
  incomplete?: string;
  // Some of the tasks that are set aside, and their number.
  set_aside_tasks?: SetAsideTask[];
  set_aside_task_count?: number;
  // Whether its guiding field is being trained; missing from coordinators without guiding.
  training?: boolean;
  preview_version: number;
  // When the frame stops; missing from coordinators without this rule. target_error is a relative
  // mean squared error, null for none.
  stop?: {target_error: number|null};
  // Digest of the EXR that provided its first samples; null for none.
  resumed_image?: string|null;
  // The state of the frame at the end of each round, if it is rendered in rounds.
  rounds?: Round[];
  // For a complete frame: the tiles with unreliable error estimates, the layers that cause them
  // (empty without layers), and the visible difference from the converged image.
  tile_count?: number;
  unreliable_tile_count?: number;
  unreliable_layers?: {layer: string; tile_count: number}[];
  flip?: number|null;
  // For a complete smooth frame: its relMSE over the relMSE without true error bars.
  one_sequence_gain?: number|null;
  progress: Progress;
}

// The kind of path that a task traces: those of a tile's pixels, light paths, or the training of a
// guiding field. The last two have the whole frame as their tile.
export type TaskKind = 'camera'|'light'|'training';

// A failed lease.
export interface Failure {
  frame_number: number;
  tile: Rect;
  task: TaskKind;
  first_sample: number;
  sample_count: number;
  worker: string;
  kind: string;
  message: string;
  time: string;
  // Renders the tile again on one machine.
  command: string;
}

// A lease held by a worker.
export interface Lease {
  frame_name: string;
  // Whether it belongs to a quote; the jobs of quotes are not listed.
  pilot: boolean;
  tile: Rect;
  task: TaskKind;
  phase: string;
}

export interface Worker {
  name: string;
  host: string;
  state: string;
  thread_count: number;
  // It renders only jobs of this pool, and jobs may require tags.
  pool?: string;
  tags?: string[];
  numeric_profile: string;
  lease_count: number;
  // The first leases: tasks being rendered before waiting ones.
  leases: Lease[];
  warm_scene_count: number;
  // File names of some of them.
  warm_scenes: string[];
  // Null if unknown.
  scene_memory_bytes: number|null;
  result_count: number;
  samples_per_second: number;
  lease_granted_count: number;
  // Those of scenes that it had to load first.
  lease_cold_count: number;
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

// Cost and gain of an effect of the scene, with standard errors.
export interface EffectCost {
  name: string;
  // Why nothing was measured; empty otherwise.
  problem: string;
  // The ablation that was measured.
  ablation: string;
  // Fraction of the processor time; negative if the ablated scene takes longer.
  time_fraction: number;
  time_fraction_error: number;
  // Change of the image's mean without the effect.
  mean_change: number;
  mean_change_error: number;
  relative_mse: number;
  // Variance of a sample with the effect over the variance without it.
  variance_ratio: number;
}

// In 8 of 10 cases the value lies between low and high.
export interface Estimate {
  value: number;
  low: number;
  high: number;
}

// Cost of refining a job to target_error (relMSE) beyond its present cost.
export interface RefinePrice {
  target_error: number;
  reached: boolean;
  relative_mse: Estimate;
  samples_per_pixel: Estimate;
  cpu_seconds: Estimate;
  // Null if there are no workers.
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

// Layers of an image, named as by the coordinator. "light" is the image before exposure;
// "difference" and "relative" compare with another frame.
export type Layer = 'image'|'light'|'error'|'samples'|'time'|'difference'|'relative';

// The part of a frame that the viewer shows.
export interface View {
  layer: Layer;
  // The name of a ChannelLayer to show as image or light; '' for the color.
  of: string;
  // The frame that differences are from; null for none.
  other: Frame|null;
}

// A layer beside the color: one or three channels.
export interface ChannelLayer {
  name: string;
  kind: 'color'|'direction'|'vector'|'scalar'|'id'|'error';
  channels: string[];
}

// "nan", "inf" or "-inf" if it is not finite.
export type PixelValue = number|string;

export interface Pixel {
  version: number;
  x: number;
  y: number;
  channels: {name: string; value: PixelValue}[];
}

// The values at the ends of the false-color scale; both are 0 while unknown.
export interface LayerRange {
  low: number;
  high: number;
}

export interface Preview {
  bitmap: ImageBitmap;
  range: LayerRange|null;
}

// The signed-in user; both are empty if the coordinator has no certificates.
export interface Session {
  user: string;
  role: string;
}

// How workers and the command line reach the coordinator.
export interface FarmAddress {
  // 0: it listens on no port of its own.
  grpc_port: number;
  // Whether it has certificates, so that everybody needs one.
  tls: boolean;
}

// A request that the coordinator refused, with its message.
export class ApiError extends Error {
  constructor(message: string, readonly status: number) {
    super(message);
  }
}

export const BASE = '/api/v1/';

export const pathOf = (name: string) => BASE + name.split('/').map(encodeURIComponent).join('/');

async function errorOf(response: Response): Promise<ApiError> {
  let message = response.statusText || 'HTTP status ' + response.status;
  try {
    message = (await response.json()).error.message;
  } catch {
    // The reply is not from the coordinator: only the status is known.
  }
  return new ApiError(message, response.status);
}

export async function request<Answer>(path: string, options: RequestInit = {}): Promise<Answer> {
  const response = await fetch(path, {cache: 'no-store', ...options});
  // The session has ended, or the farm has got certificates since the page was loaded.
  if (response.status === 401) location.assign('/login');
  if (!response.ok) throw await errorOf(response);
  return await response.json() as Answer;
}

const query = (pageSize: number, token: string) =>
    '?page_size=' + pageSize + (token ? '&page_token=' + encodeURIComponent(token) : '');

export const listJobs = (pageSize: number, token: string) =>
    request<JobPage>(BASE + 'jobs' + query(pageSize, token));
export const getJob = (name: string, pageSize: number, token: string) =>
    request<JobWithFrames>(pathOf(name) + query(pageSize, token));
export const getLayers = (frameName: string) =>
    request<{layers: ChannelLayer[]}>(pathOf(frameName) + '/layers');
export const getPixel = (frame: Frame, x: number, y: number) =>
    request<Pixel>(pathOf(frame.name) + '/pixel?x=' + x + '&y=' + y);
export const getFrame = (name: string) => request<Frame>(pathOf(name));
export const listFailures = (name: string) =>
    request<{failures: Failure[]}>(pathOf(name) + '/failures');
export const getRefinePrices = (name: string, targets: readonly number[]) =>
    request<RefinePrices>(pathOf(name) + '/refine-price?target_error=' + targets.join(','));
export const listWorkers = (pageSize: number, token: string) =>
    request<WorkerPage>(BASE + 'workers' + query(pageSize, token));
export const getFarm = () => request<FarmAddress>(BASE + 'farm');
export const getSession = () => request<Session>(BASE + 'session');
export const listCounters = () => request<{counters: Counter[]}>(BASE + 'counters');

// The header tells the coordinator that its own page sends the request, not another site.
export const OWN_PAGE = {
  'X-Sheaf-Request': '1'
};
const act = (name: string, action: string) =>
    request<Job>(pathOf(name) + action, {method: 'POST', headers: OWN_PAGE});
export async function signOut() {
  const response = await fetch('/logout', {method: 'POST', headers: OWN_PAGE});
  if (!response.ok) throw await errorOf(response);
}
export const cancelJob = (name: string) => act(name, ':cancel');
export const pauseJob = (name: string) => act(name, ':pause');
export const resumeJob = (name: string) => act(name, ':resume');
// All failed work of the job, of a frame, or of a task of it.
export const retryTasks = (name: string, frame: number|null, task: number|null) => act(
    name,
    ':retry' + (frame === null ? '' : '?frame=' + frame) + (task === null ? '' : '&task=' + task));
export const killFrame = (name: string, frame: number) => act(name, ':kill?frame=' + frame);
// Removes a job that has ended, with its images.
export const deleteJob = (name: string) =>
    request<{name: string}>(pathOf(name) + ':delete', {method: 'POST', headers: OWN_PAGE});
export const approveFrames = (name: string) => act(name, ':approve');
export const setPriority = (name: string, priority: number) =>
    act(name, ':priority?value=' + priority);
export const refineJob = (name: string, targetError: number) =>
    act(name, ':refine?target_error=' + targetError);

export const eventsPath = BASE + 'events';
export const falseColorPath = BASE + 'false-color.png';
// The present image, or the image at the end of a round.
export function previewPath(frame: Frame, view: View, round: number|null): string {
  const path = pathOf(frame.name) + '/preview.png?';
  const {layer, of, other} = view;
  if (other) {
    const kind = layer === 'relative' ? 'relative' : 'absolute';
    return path + 'difference=' + kind + '&with=' + encodeURIComponent(other.name) +
        '&version=' + frame.preview_version + '-' + other.preview_version;
  }
  const what = 'layer=' + layer + (of ? '&of=' + encodeURIComponent(of) : '');
  if (round === null) return path + what + '&version=' + frame.preview_version;
  return path + what + '&round=' + round + '&version=' + frame.rounds?.[round]?.preview_version;
}
export const thumbnailPath = (frame: PreviewFrame) =>
    pathOf(frame.name) + '/preview.png?size=thumbnail&version=' + frame.preview_version;
export const outputPath = (frame: Frame) => pathOf(frame.name) + '/output.exr';
// The delivered image in full size, for programs that read no EXR. stops: its exposure.
export const outputPngPath = (frame: Frame, stops: number) =>
    pathOf(frame.name) + '/preview.png?size=full' + (stops ? '&exposure=' + stops : '');

// The image so far; null if there is none yet. Its levels are as sent, independent of the screen.
export async function getPreview(path: string): Promise<Preview|null> {
  const response = await fetch(path);
  if (!response.ok) throw await errorOf(response);
  if (response.status === 204) return null;
  const bitmap = await createImageBitmap(
      await response.blob(), {colorSpaceConversion: 'none', premultiplyAlpha: 'none'});
  const [low, high] = (response.headers.get('X-Sheaf-Range') ?? '').split(' ').map(Number);
  return {bitmap, range: low === undefined || high === undefined ? null : {low, high}};
}
