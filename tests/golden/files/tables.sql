CREATE TABLE approvals(
  job_id INTEGER NOT NULL, frame_number INTEGER NOT NULL, samples INTEGER NOT NULL,
  approved INTEGER NOT NULL, seal INTEGER NOT NULL,
  PRIMARY KEY(job_id, frame_number)) WITHOUT ROWID;

CREATE TABLE dependencies(
  job_id INTEGER NOT NULL, on_job_id INTEGER NOT NULL, by_frame INTEGER NOT NULL,
  released INTEGER NOT NULL, removed INTEGER NOT NULL,
  PRIMARY KEY(job_id, on_job_id)) WITHOUT ROWID;

CREATE INDEX dependencies_by_job ON dependencies(on_job_id);

CREATE TABLE drains(
  worker_id TEXT PRIMARY KEY, then_exit INTEGER NOT NULL, time_ns INTEGER NOT NULL) WITHOUT ROWID;

CREATE TABLE effects(
  job_id INTEGER NOT NULL, position INTEGER NOT NULL, name TEXT NOT NULL, problem TEXT NOT NULL,
  ablation TEXT NOT NULL, time_fraction REAL NOT NULL, time_fraction_error REAL NOT NULL,
  mean_change REAL NOT NULL, mean_change_error REAL NOT NULL, relative_mse REAL NOT NULL,
  variance_ratio REAL NOT NULL, PRIMARY KEY(job_id, position)) WITHOUT ROWID;

CREATE TABLE failures(
  job_id INTEGER NOT NULL, position INTEGER NOT NULL, frame_number INTEGER NOT NULL,
  x0 INTEGER NOT NULL, y0 INTEGER NOT NULL, x1 INTEGER NOT NULL, y1 INTEGER NOT NULL,
  first INTEGER NOT NULL, count INTEGER NOT NULL, worker_id TEXT NOT NULL, kind INTEGER NOT NULL,
  message TEXT NOT NULL, time_ns INTEGER NOT NULL, task_kind INTEGER NOT NULL DEFAULT 0,
  PRIMARY KEY(job_id, position)) WITHOUT ROWID;

CREATE TABLE frames(
  job_id INTEGER NOT NULL REFERENCES jobs(job_id), frame_number INTEGER NOT NULL,
  scene_sha256 TEXT NOT NULL, scene_bytes INTEGER NOT NULL, frame_digest TEXT NOT NULL,
  width_px INTEGER NOT NULL, height_px INTEGER NOT NULL, x0 INTEGER NOT NULL, y0 INTEGER NOT NULL,
  x1 INTEGER NOT NULL, y1 INTEGER NOT NULL, samples INTEGER NOT NULL, max_depth INTEGER NOT NULL,
  seed INTEGER NOT NULL, force_generic INTEGER NOT NULL, delivered INTEGER NOT NULL DEFAULT 0,
  image_digest TEXT NOT NULL DEFAULT '', relative_mse REAL NOT NULL DEFAULT 0,
  wall_ns INTEGER NOT NULL DEFAULT 0, ray_count INTEGER NOT NULL DEFAULT 0,
  nonfinite_count INTEGER NOT NULL DEFAULT 0, cpu_ns INTEGER NOT NULL DEFAULT 0,
  color INTEGER NOT NULL DEFAULT 0, single_scattering INTEGER NOT NULL DEFAULT 0,
  outputs TEXT NOT NULL DEFAULT '', primaries INTEGER NOT NULL DEFAULT 0,
  white_balance_k REAL NOT NULL DEFAULT 0, one_sequence INTEGER NOT NULL DEFAULT 0,
  similarity_after INTEGER NOT NULL DEFAULT 0, target_error REAL NOT NULL DEFAULT 0,
  time_max_ns INTEGER NOT NULL DEFAULT 9223372036854775807,
  cpu_max_ns INTEGER NOT NULL DEFAULT 9223372036854775807,
  first_round_samples INTEGER NOT NULL DEFAULT 16, tile_count INTEGER NOT NULL DEFAULT 0,
  unreliable_tile_count INTEGER NOT NULL DEFAULT 0, sample_count INTEGER NOT NULL DEFAULT 0,
  part_bytes INTEGER NOT NULL DEFAULT 0, relative_mse_upper REAL NOT NULL DEFAULT 0,
  stop_reason INTEGER NOT NULL DEFAULT 0, pixel_stride_px INTEGER NOT NULL DEFAULT 1,
  flip REAL NOT NULL DEFAULT 0, resumed_sha256 TEXT NOT NULL DEFAULT '',
  resumed_bytes INTEGER NOT NULL DEFAULT 0, unreliable_layers TEXT NOT NULL DEFAULT '',
  one_sequence_gain REAL NOT NULL DEFAULT 0, sensor TEXT NOT NULL DEFAULT '',
  max_component_value REAL NOT NULL DEFAULT 0, correction_count INTEGER NOT NULL DEFAULT 0,
  seal INTEGER NOT NULL DEFAULT 0, techniques INTEGER NOT NULL DEFAULT 0,
  light_samples_max INTEGER NOT NULL DEFAULT 0, eye_distance REAL NOT NULL DEFAULT 0,
  eye_convergence REAL NOT NULL DEFAULT 0, certified INTEGER NOT NULL DEFAULT 0,
  left_eye_relative_mse REAL NOT NULL DEFAULT 0, right_eye_relative_mse REAL NOT NULL DEFAULT 0,
  eye_difference_relative_mse REAL NOT NULL DEFAULT 0,
  PRIMARY KEY(job_id, frame_number)) WITHOUT ROWID;

CREATE TABLE job_events(
  job_id INTEGER NOT NULL, position INTEGER NOT NULL, time_ns INTEGER NOT NULL, what TEXT NOT NULL,
  who TEXT NOT NULL, of_frame INTEGER NOT NULL, frame_number INTEGER NOT NULL, text TEXT NOT NULL,
  PRIMARY KEY(job_id, position)) WITHOUT ROWID;

CREATE TABLE jobs(
  job_id INTEGER PRIMARY KEY AUTOINCREMENT, request_id TEXT NOT NULL UNIQUE, title TEXT NOT NULL,
  priority INTEGER NOT NULL, numeric_profile TEXT NOT NULL, tile_size_px INTEGER NOT NULL,
  pass_sample_count INTEGER NOT NULL, lease_pass_count INTEGER NOT NULL, phase INTEGER NOT NULL,
  failure TEXT NOT NULL, create_ns INTEGER NOT NULL, end_ns INTEGER NOT NULL,
  paused INTEGER NOT NULL DEFAULT 0, failure_count INTEGER NOT NULL DEFAULT 0,
  cell_size_px INTEGER NOT NULL DEFAULT 0, wall_ns INTEGER NOT NULL DEFAULT 0,
  warning TEXT NOT NULL DEFAULT '', owner TEXT NOT NULL DEFAULT 'local',
  seal INTEGER NOT NULL DEFAULT 0, pinned INTEGER NOT NULL DEFAULT 0,
  parts_removed_ns INTEGER NOT NULL DEFAULT 9223372036854775807,
  state_seal INTEGER NOT NULL DEFAULT 0, show TEXT NOT NULL DEFAULT 'default',
  pool TEXT NOT NULL DEFAULT 'default', required_tags TEXT NOT NULL DEFAULT '',
  memory_min_bytes INTEGER NOT NULL DEFAULT 0, memory_expected_bytes INTEGER NOT NULL DEFAULT 0,
  deadline_ns INTEGER NOT NULL DEFAULT 9223372036854775807,
  quoted_cpu_seconds REAL NOT NULL DEFAULT 0, quoted_cpu_seconds_low REAL NOT NULL DEFAULT 0,
  quoted_cpu_seconds_high REAL NOT NULL DEFAULT 0, command TEXT NOT NULL DEFAULT '');

CREATE TABLE meta(key TEXT PRIMARY KEY, value INTEGER NOT NULL) WITHOUT ROWID;

CREATE TABLE parts(
  job_id INTEGER NOT NULL, frame_number INTEGER NOT NULL, kind INTEGER NOT NULL,
  y0 INTEGER NOT NULL, x0 INTEGER NOT NULL, first INTEGER NOT NULL, count INTEGER NOT NULL,
  cells INTEGER NOT NULL, y1 INTEGER NOT NULL, x1 INTEGER NOT NULL, cell_size_px INTEGER NOT NULL,
  sha256 TEXT NOT NULL, size_bytes INTEGER NOT NULL, worker_id TEXT NOT NULL,
  ray_count INTEGER NOT NULL, nonfinite_count INTEGER NOT NULL, cpu_ns INTEGER NOT NULL,
  identity TEXT NOT NULL, seal INTEGER NOT NULL, field TEXT NOT NULL DEFAULT '',
  PRIMARY KEY(job_id, frame_number, kind, y0, x0, first, count, cells)) WITHOUT ROWID;

CREATE INDEX parts_by_identity ON parts(identity);

CREATE TABLE quarantines(
  identity TEXT PRIMARY KEY, reason TEXT NOT NULL, made_false_results INTEGER NOT NULL,
  time_ns INTEGER NOT NULL) WITHOUT ROWID;

CREATE TABLE removed_jobs(
  job_id INTEGER PRIMARY KEY);

CREATE TABLE rounds(
  job_id INTEGER NOT NULL, frame_number INTEGER NOT NULL, round INTEGER NOT NULL,
  relative_mse REAL NOT NULL, relative_mse_upper REAL NOT NULL,
  predicted_relative_mse REAL NOT NULL, sample_count INTEGER NOT NULL,
  sample_count_expected INTEGER NOT NULL, wall_ns INTEGER NOT NULL, ray_count INTEGER NOT NULL,
  nonfinite_count INTEGER NOT NULL, cpu_ns INTEGER NOT NULL, part_bytes INTEGER NOT NULL,
  stop_reason INTEGER NOT NULL, tiles BLOB NOT NULL, seal INTEGER NOT NULL DEFAULT 0,
  certified_upper REAL NOT NULL DEFAULT 0,
  PRIMARY KEY(job_id, frame_number, round)) WITHOUT ROWID;

CREATE TABLE shares(
  kind INTEGER NOT NULL, name TEXT NOT NULL, weight REAL NOT NULL, threads_max INTEGER NOT NULL,
  PRIMARY KEY(kind, name)) WITHOUT ROWID;

CREATE TABLE sqlite_sequence(name,seq);

CREATE TABLE task_failures(
  job_id INTEGER NOT NULL, frame_number INTEGER NOT NULL, task_kind INTEGER NOT NULL,
  x0 INTEGER NOT NULL, y0 INTEGER NOT NULL, x1 INTEGER NOT NULL, y1 INTEGER NOT NULL,
  first INTEGER NOT NULL, count INTEGER NOT NULL, cell_size_px INTEGER NOT NULL,
  cells INTEGER NOT NULL, worker_id TEXT NOT NULL, identity TEXT NOT NULL, kind INTEGER NOT NULL,
  times INTEGER NOT NULL, words TEXT NOT NULL, seal INTEGER NOT NULL,
  PRIMARY KEY(job_id, frame_number, task_kind, y0, x0, first, count, cells, worker_id, kind))
  WITHOUT ROWID;

CREATE TABLE usage(
  day INTEGER NOT NULL, owner TEXT NOT NULL, show TEXT NOT NULL, job_id INTEGER NOT NULL,
  result_count INTEGER NOT NULL, sample_count INTEGER NOT NULL, ray_count INTEGER NOT NULL,
  cpu_ns INTEGER NOT NULL, repeated_count INTEGER NOT NULL, repeated_cpu_ns INTEGER NOT NULL,
  lost_count INTEGER NOT NULL, lost_cpu_ns INTEGER NOT NULL, upload_bytes INTEGER NOT NULL,
  part_bytes INTEGER NOT NULL, image_bytes INTEGER NOT NULL,
  PRIMARY KEY(day, owner, show, job_id)) WITHOUT ROWID;
