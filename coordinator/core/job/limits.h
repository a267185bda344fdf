// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Every limit of the coordinator's decisions, by name, with its default and reason.
#pragma once

#include <cstddef>
#include <cstdint>

#include "absl/time/time.h"

namespace sheaf::coordinator {

struct Limits {
  // Leases and heartbeats.
  absl::Duration lease_duration = absl::Seconds(30);  // A worker silent for longer is lost.
  absl::Duration lease_age_max = absl::Hours(2);      // A lease that never ends is a hung renderer.
  absl::Duration heartbeat_interval_max = absl::Seconds(5);    // For a worker that holds leases.
  absl::Duration idle_interval_min = absl::Milliseconds(200);  // For a worker that waits for work.
  absl::Duration round_interval_min =
      absl::Milliseconds(20);          // The same if a frame's next round is soon.
  double synchronize_rate_max = 2000;  // Calls per second; more idle workers ask less often.
  int leases_per_worker_max = 256;
  // A worker that has delivered little gets few leases, so that a stranger cannot hoard a farm's
  // work: a minimum, plus some per reported thread, plus some per result.
  int unproven_leases_min = 4;
  int unproven_leases_per_thread = 2;
  int threads_believed_max = 64;
  int leases_per_result = 4;
  size_t leases_per_identity_max = 16'384;  // All workers of one certificate.
  int warm_scenes_max = 64;                 // Examined in one Synchronize.
  int workers_max = 100'000;
  size_t drains_max = 10'000;                        // Workers drained at once.
  absl::Duration lost_worker_kept = absl::Hours(1);  // Then it is forgotten.

  // Jobs.
  int frames_per_job_max = 100'000;
  int live_jobs_max = 10'000;
  size_t job_dependencies_max = 16;  // Jobs that a job waits for.
  // Sums over the unfinished jobs of each user; without certificates there are no users. Samples
  // are pixel samples.
  int64_t owner_jobs_max = 2'000;
  uint64_t owner_bytes_max = UINT64_MAX;  // Kept on the disk for a user (owner_bytes.h).
  int64_t owner_frames_max = 200'000;
  uint64_t owner_samples_max = uint64_t{1} << 53;
  absl::Duration pilot_unasked_max = absl::Seconds(30);  // Then an unrequested pilot is cancelled.
  // Per opened frame: opening one blocks all other calls.
  int64_t tiles_per_frame_max = int64_t{1} << 18;  // The largest frame in tiles of 32 px.
  int64_t cells_per_frame_max = int64_t{1} << 20;
  uint64_t samples_max = uint64_t{1} << 40;  // Per pixel.
  // Rendered pixels of a frame: its image takes 20 GiB in the coordinator.
  int64_t frame_pixels_max = int64_t{1} << 28;
  // Pixel samples of a frame, and of a job: more than farms render in a year, and sums of a job are
  // whole numbers in JSON.
  uint64_t frame_samples_max = uint64_t{1} << 48;
  uint64_t job_samples_max = uint64_t{1} << 53;
  int64_t job_tasks_max = int64_t{1} << 28;  // Each is a file until its frame is delivered.
  int32_t frame_edge_px_max = 65'536;
  // Frames that are open at once share this many pixels; one is always allowed. An open frame costs
  // the coordinator about 80 bytes a pixel for its developed image. With outputs, a pixel counts
  // for more as its channels are more.
  int64_t open_pixels_max = int64_t{32} << 20;
  int priority_magnitude_max = 1000;

  // Placement (coordinator/scheduling/placement.h). A job is passed over for at most this long,
  // without a lease, in favor of warm scenes: three leases.
  absl::Duration warm_wait_max = absl::Seconds(30);
  // A worker that began a scene keeps its warm work for at least this long. If a scene takes as
  // long to load, at most half of the worker's time goes into loading.
  absl::Duration warm_stay_min = absl::Seconds(30);
  uint32_t placement_scenes_max = 64;  // Jobs with more scenes are not found by scene.
  int placement_jobs_max = 256;        // Examined by scene, per lease.
  int placement_frames_max = 16;       // Per job, for its work left.

  // Size of leases if the job leaves it to the coordinator.
  double lease_target_seconds = 10.0;  // Long relative to a result's overhead, short for a loss.
  double first_lease_target_seconds =
      0.25;                           // A tile's first lease is short: a whole preview early.
  uint64_t first_lease_fraction = 8;  // ... and at most 1/8 of the tile's samples.
  // A lease has at most 1/2 of what is left of the frame, divided among the leases that the farm
  // renders at once: leases shrink at the end (coordinator/scheduling/placement/lease_length.h).
  double tail_divisor = 2.0;
  uint64_t lease_pass_count_max = 1024;
  // Light passes of a lease: a power of two. The worker holds the sums of this many passes for the
  // whole frame (LightPassAccumulator); a replicate has at most one of them.
  uint64_t light_pass_count_max = 16;
  // A lease of light passes takes longer than others, because its result is as large as the frame.
  double light_lease_target_seconds = 30.0;
  // ... and limits its passes so that the result is not larger than this. A frame whose single pass
  // is larger is refused. One pass of 3840 x 2160 pixels with the bias of merging has some 760 MiB.
  // Below FarmOptions::part_bytes_max.
  uint64_t light_part_bytes_max = uint64_t{960} << 20;

  // Failures, by class. A task is set aside when one of its budgets is used up.
  int poison_workers_max = 3;    // Distinct workers that failed it themselves, by any class; each
  int crash_workers_max = 3;     // gets one attempt. By a crash, ...
  int memory_workers_max = 3;    // ... by lack of memory, ...
  int invalid_workers_max = 2;   // ... and by an invalid result, which is no accident.
  int lost_failures_max = 1024;  // Workers that vanished while rendering it: machines that are
                                 // switched off must not spoil a job.
  int infrastructure_failures_max = 16;
  // The only worker of a farm may fail this many tasks of a frame by lack of memory before the
  // frame waits for another worker.
  int lone_memory_failures_max = 3;
  // A job fails for these.
  int loading_losses_max = 3;         // Workers that vanished one after the other while they loaded
  int job_loading_losses_max = 6;     // a frame not yet loaded; the same over a job's frames.
  int scene_failure_workers_max = 2;  // Distinct workers that report a scene failure.
  size_t worker_text_shown_max = 2000;  // Bytes of a worker's message shown to users.
  int failures_kept_max = 32;           // The last ones of a job, for users.
  int sick_jobs_min = 3;                // A worker that failed tasks of this many jobs in this
  absl::Duration sick_window = absl::Hours(1);            // time, which others rendered, is sick.
  size_t quarantines_max = 10'000;                        // Beyond, the oldest are forgotten.
  absl::Duration retry_delay_initial = absl::Seconds(1);  // After infrastructure failures: of the
  absl::Duration retry_delay_max = absl::Minutes(1);      // worker, doubling.

  // Checks: results that are rendered again by another identity, to notice false ones.
  double check_fraction = 0.02;               // Fraction of tasks; 0: none.
  double new_identity_check_fraction = 0.25;  // For an identity's first results.
  uint64_t new_identity_results = 16;
  size_t result_versions_max = 5;  // Different results of a task; then it stays undecided.
  // How long a rendered frame waits for checks: a multiple of a check's expected time since the
  // last check arrived. At least the minimum, and at most the maximum in total. The minimum if only
  // identities that have delivered nothing may do the checks.
  double check_wait_factor = 4;
  absl::Duration check_wait_min = absl::Seconds(5);
  absl::Duration check_wait_max = absl::Minutes(2);
  int check_identities_scan_max = 256;  // Examined for one that has delivered results.

  // Shares, limits and requirements.
  size_t share_settings_max = 10'000;   // Set by operators.
  size_t idle_shares_max = 1'000;       // Users or shows without jobs that are ahead of others.
  double share_lag_max_seconds = 10;    // Per thread in use: the most that a user who could not
                                        // be served catches up.
  int share_scan_max = 1024;            // Users and shows examined per lease.
  size_t requirement_groups_max = 256;  // Different requirements of unfinished jobs.
  int worker_kinds_scan_max = 256;      // Kinds of workers examined for a job's memory.

  // Hedges. A task that is leased twice gets another holder once all its holders are overdue: each
  // has held it for a multiple of its expected time, and for at least the minimum.
  double overdue_factor = 4;
  absl::Duration overdue_min = absl::Seconds(5);
  size_t hedge_holders_max = 8;

  // Bounded scans, so that no call's cost grows with the farm.
  int job_scan_max = 64;
  int avoid_scan_max = 64;
  int hedge_scan_max = 64;
  int check_scan_max = 64;
};

}  // namespace sheaf::coordinator
