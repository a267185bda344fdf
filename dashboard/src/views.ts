// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The objects of the coordinator's HTTP API; docs/reference/grpc.md describes their fields. Made by
// build/release/bin/sheaf_golden_test --renew from coordinator/service/view: do not edit it.

export interface Dependency {
  job_name: string;
  by_frame: boolean;
  state: string;
}

export interface PreviewFrame {
  name: string;
  preview_version: number;
  complete: boolean;
}

export interface Progress {
  sample_count_done: number;
  sample_count_total: number;
  relative_mse: number|null;
  nonfinite_count: number;
  ray_count: number;
  cpu_duration_seconds: number;
  wall_duration_seconds: number;
  remaining_duration_seconds: number|null;
  remaining_duration_low_seconds: number|null;
  remaining_duration_high_seconds: number|null;
  remaining_duration_alone_seconds: number|null;
}

export interface Job {
  name: string;
  title: string;
  pilot: boolean;
  state: 'queued'|'running'|'succeeded'|'failed'|'cancelled'|'paused';
  owner: string;
  show: string;
  pool: string;
  required_tags: string[];
  memory_min_bytes: number|null;
  memory_expected_bytes: number|null;
  priority: number;
  numeric_profile: string;
  failure: string;
  waiting_reason: string;
  warning: string;
  failure_count: number;
  pinned: boolean;
  parts_removed_time: string|null;
  create_time: string;
  end_time: string|null;
  frame_count: number;
  frame_complete_count: number;
  incomplete_frame_count: number;
  training_frame_count: number;
  unapproved_frame_count: number;
  dependencies: Dependency[];
  deadline_time: string|null;
  held: boolean;
  command: string;
  preview_frame: PreviewFrame|null;
  progress: Progress;
}

export interface Rect {
  x0_px: number;
  y0_px: number;
  x1_px: number;
  y1_px: number;
}

export interface StopRule {
  target_error: number|null;
  time_max_seconds: number|null;
  cpu_max_seconds: number|null;
  certified: boolean;
}

export interface Round {
  relative_mse: number;
  relative_mse_upper: number;
  predicted_relative_mse: number;
  prediction_ratio: number;
  sample_count: number;
  ray_count: number;
  cpu_duration_seconds: number;
  wall_duration_seconds: number;
  part_bytes: number;
  certified_relative_mse: number;
  preview_version: number;
}

export interface UnreliableLayer {
  layer: string;
  tile_count: number;
}

export interface TaskFailure {
  kind: string;
  worker: string;
  count: number;
  message: string;
}

export interface SetAsideTask {
  task: number;
  why: string;
  failures: TaskFailure[];
}

export interface Frame {
  name: string;
  frame_number: number;
  scene_digest: string;
  frame_digest: string;
  width_px: number;
  height_px: number;
  window: Rect;
  sample_count: number;
  resumed_image: string|null;
  stop: StopRule;
  stop_reason: 'samples'|'target-error'|'time'|'cpu'|'';
  rounds: Round[];
  tile_count: number;
  unreliable_tile_count: number;
  unreliable_layers: UnreliableLayer[];
  flip: number|null;
  left_eye_relative_mse: number|null;
  right_eye_relative_mse: number|null;
  eye_difference_relative_mse: number|null;
  certificate: string;
  correction_count: number;
  one_sequence_gain: number|null;
  depth_max: number;
  seed: number;
  one_sequence: boolean;
  similarity_after_count: number;
  light_samples_max: number;
  techniques: string;
  eye_distance: number;
  eye_convergence: number;
  sensor: string;
  max_component_value: number;
  pixel_stride_px: number;
  training: boolean;
  complete: boolean;
  incomplete: string;
  waiting_reason: string;
  set_aside_tasks: SetAsideTask[];
  set_aside_task_count: number;
  image_digest: string;
  preview_version: number;
  progress: Progress;
}

export interface EffectCost {
  name: string;
  problem: string;
  ablation: string;
  time_fraction: number;
  time_fraction_error: number;
  mean_change: number;
  mean_change_error: number;
  relative_mse: number;
  variance_ratio: number;
}

export interface Failure {
  frame_name: string;
  frame_number: number;
  tile: Rect;
  task: 'camera'|'light'|'training';
  first_sample: number;
  sample_count: number;
  worker: string;
  kind: 'released'|'infrastructure'|'scene'|'memory'|'internal'|'lost'|'loading'|'invalid';
  message: string;
  time: string;
  command: string;
}

export interface JobEvent {
  time: string;
  what: string;
  who: string;
  frame_number: number|null;
  text: string;
}

export interface Lease {
  frame_name: string;
  pilot: boolean;
  tile: Rect;
  task: 'camera'|'light'|'training';
  first_sample: number;
  sample_count: number;
  phase: 'queued'|'loading'|'rendering'|'uploading';
  grant_time: string;
}

export interface Worker {
  name: string;
  identity: string;
  host: string;
  state: 'idle'|'busy'|'draining'|'lost'|'quarantined'|'stopped'|'sick';
  thread_count: number;
  pool: string;
  tags: string[];
  memory_bytes: number|null;
  numeric_profile: string;
  lease_count: number;
  leases: Lease[];
  warm_scene_count: number;
  warm_scenes: string[];
  scene_memory_bytes: number|null;
  result_count: number;
  samples_per_second: number;
  lease_granted_count: number;
  lease_cold_count: number;
  last_seen_time: string;
  reason: string;
  drained: boolean;
  then_exit: boolean;
}

export interface Estimate {
  value: number;
  low: number;
  high: number;
}

export interface RefinePrice {
  target_error: number;
  reached: boolean;
  relative_mse: Estimate;
  samples_per_pixel: Estimate;
  cpu_seconds: Estimate;
  wall_seconds: Estimate|null;
}

export interface RefinePrices {
  prices: RefinePrice[];
  thread_count: number;
  jobs_before_count: number;
}

export interface Removal {
  kind: string;
  job: string|null;
  reason: string;
  item_count: number;
  size_bytes: number;
}
