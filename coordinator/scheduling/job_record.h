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

// A frame as the scheduler sees it. Jobs have many: one that waits has less than 300 bytes of
// memory, all told.
struct FrameRecord {
  // kPending: not begun. kOpen: has tasks in memory. kRendered: all samples are done. kDelivered:
  // the EXR is there. kIncomplete: all is done but what is set aside. kClosed: its job ended
  // before.
  enum class Phase : uint8_t { kPending, kOpen, kRendered, kDelivered, kIncomplete, kClosed };
  PackedFrame packed;
  Phase phase = Phase::kPending;
  bool loaded = false;                                   // Its scene, by any worker, ever.
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
// Samples that each cell gets in the frame's first round, or in all where it has no rounds.
uint64_t FirstRoundSamplesOf(const FrameRecord& frame);
// Pixel samples of the whole frame, light paths included: where it is rendered in rounds, as far as
// they are decided.
uint64_t SampleCountTotal(const FrameRecord& frame);
// Why a frame is incomplete: how many tasks are set aside, and one of them as an example. Empty
// where none is.
std::string IncompleteText(const FrameRecord& frame);

// A worker whose cache has no room for a scene of the job.
struct CacheRefusal {
  uint64_t needed_bytes = 0, room_bytes = 0;
  int count = 0;
  SteadyTime not_before;  // The worker is asked again, for its disk may have room then.
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
  int requirement_group = 0;  // Of the live jobs with these requirements.
  SteadyTime paused_time = SteadyTime::InfiniteFuture();  // InfiniteFuture while it is not paused.
  // Since when it is passed over (placement.h), since its last lease; InfiniteFuture: it is not.
  SteadyTime passed_time = SteadyTime::InfiniteFuture();
  int32_t delivered_count = 0;
  int32_t incomplete_count = 0;
  bool blocked = false;          // As a whole it waits for another job.
  int32_t unapproved_count = 0;  // Delivered frames that wait for approval.

  OwnerWork work;  // Of the owner's, while the job is live.
  FailureLog failures;
  LoadingLosses loading_losses;  // Since a frame was loaded for the first time.
  std::map<int32_t, LoadingLosses> frame_loading_losses;  // By number, of frames not yet loaded.
  std::map<std::string, CacheRefusal> cache_refusals;     // By worker, until it loads a scene.

  std::optional<uint32_t> FindIndex(int32_t frame_number) const;
  // Requires: there is such a frame.
  uint32_t IndexOf(int32_t frame_number) const;
  bool Paused() const { return paused_time != SteadyTime::InfiniteFuture(); }
  bool MayLease() const { return !Paused() && !blocked; }
  // Whether the worker's cache lately had no room for the job.
  bool IsRefusedByCacheOf(const std::string& worker_id, SteadyTime now) const;
};
// Pixel samples of the frame per second and thread of the worker: what the frame's samples cost so
// far, on workers as fast as this one, or without any what other frames' do. 0: not known.
double SamplesPerThreadSecond(const FrameRecord& frame, const WorkerRecord& worker);
// The CPU time that the task is expected to take, by what the frame's samples cost so far; until
// one is timed, unless_known. A training's is never known.
absl::Duration ExpectedCpu(const FrameRecord& frame, const Task& task, absl::Duration unless_known);
// The first of all its frames, in this life; InfiniteFuture before.
SteadyTime FirstLeaseTime(const JobRecord& job);
// sample_count_left: of all or some of the job's samples. A sample is expected to cost what those
// of the job did that are timed.
WorkLeft WorkLeftOf(const JobRecord& job, uint64_t sample_count_left);

}  // namespace sheaf::coordinator
