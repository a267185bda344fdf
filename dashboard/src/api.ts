// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The coordinator's HTTP API. Names become path segments, each escaped.

import type {
  EffectCost, Failure, Frame, Job, JobEvent, PreviewFrame, RefinePrices, Worker
} from './views';

export type * from './views';

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
  // The frame that differences are from, and the layer of it as in `of`; null for none.
  other: Frame|null;
  otherOf: string;
  // The chosen ends of the false colors; null for those of the values.
  range: LayerRange|null;
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

// The usage of one user's jobs on one day.
export interface UsageRow {
  day: string|null;
  user: string;
  sample_count: number;
  cpu_seconds: number;
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

// No answer at all: the coordinator or the network is away.
export class UnreachableError extends Error {
  constructor() {
    super('the coordinator does not answer');
  }
}

async function ask(path: string, options: RequestInit = {}): Promise<Response> {
  try {
    return await fetch(path, options);
  } catch {
    // fetch fails only if there is no answer; each browser has its own words for that.
    throw new UnreachableError();
  }
}

export async function request<Answer>(path: string, options: RequestInit = {}): Promise<Answer> {
  const response = await ask(path, {cache: 'no-store', ...options});
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
export const listEvents = (name: string) =>
    request<{events: JobEvent[]}>(pathOf(name) + '/log');
export const getRefinePrices = (name: string, targets: readonly number[]) =>
    request<RefinePrices>(pathOf(name) + '/refine-price?target_error=' + targets.join(','));
export const listWorkers = (pageSize: number, token: string) =>
    request<WorkerPage>(BASE + 'workers' + query(pageSize, token));
export const getFarm = () => request<FarmAddress>(BASE + 'farm');
export const getSession = () => request<Session>(BASE + 'session');
// The usage of each user on each day since one, such as 2026-05-01.
export const listUsage = (since: string) =>
    request<{usage: UsageRow[]}>(BASE + 'usage?by=user&daily=1&since=' + since);
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
export const drainWorker = (name: string, drain: boolean) => request<Worker>(
    pathOf(name) + (drain ? ':drain' : ':undrain'), {method: 'POST', headers: OWN_PAGE});
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
  const {layer, of, other, otherOf} = view;
  const range = view.range ? '&range=' + view.range.low + ',' + view.range.high : '';
  if (other) {
    const kind = layer === 'relative' ? 'relative' : 'absolute';
    return path + 'difference=' + kind + '&with=' + encodeURIComponent(other.name) +
        (of ? '&of=' + encodeURIComponent(of) : '') +
        (otherOf ? '&with_of=' + encodeURIComponent(otherOf) : '') + range +
        '&version=' + frame.preview_version + '-' + other.preview_version;
  }
  const what = 'layer=' + layer + (of ? '&of=' + encodeURIComponent(of) : '') + range;
  if (round === null) return path + what + '&version=' + frame.preview_version;
  return path + what + '&round=' + round + '&version=' + frame.rounds[round]?.preview_version;
}
export const thumbnailPath = (frame: PreviewFrame) =>
    pathOf(frame.name) + '/preview.png?size=thumbnail&version=' + frame.preview_version;
export const outputPath = (frame: Frame) => pathOf(frame.name) + '/output.exr';
// The delivered image in full size, for programs that read no EXR. stops: its exposure.
export const outputPngPath = (frame: Frame, stops: number) =>
    pathOf(frame.name) + '/preview.png?size=full' + (stops ? '&exposure=' + stops : '');

// The image so far; null if there is none yet. Its levels are as sent, independent of the screen.
export async function getPreview(path: string): Promise<Preview|null> {
  const response = await ask(path);
  if (!response.ok) throw await errorOf(response);
  if (response.status === 204) return null;
  const bitmap = await createImageBitmap(
      await response.blob(), {colorSpaceConversion: 'none', premultiplyAlpha: 'none'});
  const [low, high] = (response.headers.get('X-Sheaf-Range') ?? '').split(' ').map(Number);
  return {bitmap, range: low === undefined || high === undefined ? null : {low, high}};
}
