// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A job and its frames as the scheduler holds them. Values without locks; their owner is Scheduler.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/container/btree_map.h"
#include "common/base/steady_time.h"
#include "coordinator/core/frame/frame_tasks.h"
#include "coordinator/core/job/owner_work.h"
#include "coordinator/core/job/work_left.h"
#include "coordinator/scheduling/lease_table.h"
#include "coordinator/scheduling/loading_losses.h"
#include "coordinator/scheduling/packed_frame.h"
#include "coordinator/scheduling/pending_frames.h"
#include "coordinator/scheduling/task_failures.h"
#include "coordinator/scheduling/worker_table.h"

namespace sheaf::coordinator {

// A frame as the scheduler sees it. Jobs have many: a waiting frame takes less than 300 bytes of
// memory in total.
struct FrameRecord {
  // kPending: not begun. kOpen: has tasks in memory. kRendered: all samples are done. kDelivered:
  // the EXR is written. kIncomplete: all is done except tasks that are set aside. kClosed: its job
  // ended first.
  enum class Phase : uint8_t { kPending, kOpen, kRendered, kDelivered, kIncomplete, kClosed };
  PackedFrame packed;
  Phase phase = Phase::kPending;
  bool loaded = false;                                   // Some worker has loaded its scene.
  bool blocked = false;                                  // It waits for a frame of another job.
  std::unique_ptr<FrameTasks> tasks;                     // While open or rendered.
  absl::btree_map<TaskId, TaskFailures> failures;        // A whole frame's are at FrameTroubleId.
  absl::btree_map<std::string, FailureKind> refused_by;  // By worker: scene or memory.
  absl::btree_map<std::string, std::string> scene_failed_by;  // By identity, what it says.
  SteadyTime first_lease_time = SteadyTime::InfiniteFuture();
  uint64_t sample_count_done = 0;   // Pixel samples; valid in every phase.
  uint64_t sample_count_timed = 0;  // Those whose CPU time is in cost.
  ResultCost cost;

  int32_t number() const { return packed.frame_number(); }
  const FrameSettings& settings() const { return packed.shape().settings; }
  const StopRule& stop() const { return packed.shape().stop; }
  FrameSpec Spec() const { return packed.Unpack(); }
};
// Samples that each cell gets in the frame's first round, or in total if it has no rounds.
uint64_t FirstRoundSamplesOf(const FrameRecord& frame);
// Pixel samples of the whole frame, light paths included. For a frame with rounds: of the rounds
// decided so far.
uint64_t SampleCountTotal(const FrameRecord& frame);
// Explains why a frame is incomplete: the number of tasks set aside, and one of them as an example.
// Empty if there is none.
std::string IncompleteText(const FrameRecord& frame);

// A worker whose cache has no room for a scene of the job.
struct CacheRefusal {
  uint64_t needed_bytes = 0, room_bytes = 0;
  int count = 0;
  SteadyTime not_before;  // The worker is tried again: its disk may have room by then.
};

struct JobRecord {
  JobSpec spec;  // Without frames: they are in `frames`.
  JobPhase phase = JobPhase::kLive;
  std::string failure;
  std::vector<FrameRecord> frames;  // Ascending by number.
  FrameShapes shapes;               // The frames refer to its entries.
  PendingFrames pending;
  using FrameSet = std::set<uint32_t>;  // Indices into frames.
  FrameSet ready;                       // Open with something to lease.
  std::map<std::string, FrameSet> ready_by_scene;
  int requirement_group = 0;  // The group of live jobs with these requirements.
  SteadyTime paused_time = SteadyTime::InfiniteFuture();  // InfiniteFuture while it is not paused.
  // When the job was first passed over (placement.h) since its last lease; InfiniteFuture: it was
  // not.
  SteadyTime passed_time = SteadyTime::InfiniteFuture();
  int32_t delivered_count = 0;
  int32_t incomplete_count = 0;
  bool blocked = false;          // The whole job waits for another job.
  int32_t unapproved_count = 0;  // Delivered frames that wait for approval.

  OwnerWork work;  // Its part of the owner's work, while live.
  FailureLog failures;
  LoadingLosses loading_losses;  // Since a frame was loaded for the first time.
  std::map<int32_t, LoadingLosses> frame_loading_losses;  // By number, of frames not yet loaded.
  std::map<std::string, CacheRefusal> cache_refusals;     // By worker, until it loads a scene.

  std::optional<uint32_t> FindIndex(int32_t frame_number) const;
  // Requires: there is such a frame.
  uint32_t IndexOf(int32_t frame_number) const;
  bool Paused() const { return paused_time != SteadyTime::InfiniteFuture(); }
  bool MayLease() const { return !Paused() && !blocked; }
  // Whether the worker's cache recently had no room for the job.
  bool IsRefusedByCacheOf(const std::string& worker_id, SteadyTime now) const;
};
// Pixel samples of the frame per second and thread of the worker, from the cost of the frame's
// samples so far, scaled to this worker's speed. Without samples: from other frames. 0: not known.
double SamplesPerThreadSecond(const FrameRecord& frame, const WorkerRecord& worker);
// The CPU time that the task is expected to take, from the cost of the frame's samples so far.
// Returns unless_known until a sample is timed, and always for a training.
absl::Duration ExpectedCpu(const FrameRecord& frame, const Task& task, absl::Duration unless_known);
// The first lease of any of its frames since the coordinator started; InfiniteFuture before.
SteadyTime FirstLeaseTime(const JobRecord& job);
// sample_count_left: of all or some of the job's samples. A sample is expected to cost as much as
// the job's timed samples.
WorkLeft WorkLeftOf(const JobRecord& job, uint64_t sample_count_left);

}  // namespace sheaf::coordinator
