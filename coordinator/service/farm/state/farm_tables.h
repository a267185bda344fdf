// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FarmTables: the tables of a farm that change together, under one mutex: the scheduler, and what
// the scheduler need not know of jobs and of their open frames. The classes of this folder share
// it. The mutex is never held while a disk or an image is worked on.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/base/mutex.h"
#include "common/base/steady_time.h"
#include "coordinator/core/frame/sample_rounds.h"
#include "coordinator/core/job/limits.h"
#include "coordinator/forecast/work_ahead.h"
#include "coordinator/scheduling/scheduler.h"
#include "coordinator/service/farm/state/open_frame.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator {

// The properties of a job that the scheduler does not need.
struct JobAccount {
  absl::Time create_time;
  absl::Time end_time = absl::InfiniteFuture();
  SteadyTime ended = SteadyTime::InfiniteFuture();  // The same, where it was in this life.
  std::map<int32_t, DeliveredFrame> delivered;
  // By frame. Cells of the last round only, and only of frames that are not delivered.
  std::map<int32_t, std::vector<RoundRecord>> rounds;
  std::map<int32_t, absl::Duration> wall_before;  // By frame: before this start.
  absl::Duration job_wall_before;                 // The same for the job as a whole.
  std::string warning;                            // StoredJob's; so are the next ones.
  std::map<int32_t, int32_t> corrections;
  bool pinned = false;
  absl::Time parts_removed_time = absl::InfiniteFuture();

  // In this life.
  bool EndedWithin(absl::Duration duration, SteadyTime now) const {
    return ended != SteadyTime::InfiniteFuture() && now - ended < duration;
  }
};

// An open frame and how it stands, as of its last refresh.
struct OpenEntry {
  std::shared_ptr<OpenFrame> frame;
  double relative_mse = 0;
  uint64_t preview_version = 0;
};

// The samples after which a frame without rounds gets its next point.
uint64_t NextPoint(const RoundRecord& last);

// Thread safety: all members may be used concurrently, as annotated. Locks are taken in this order:
// a tile's reservation, an open frame's mutex or that of preparing frames, the tables' mutex, that
// of PartRemovals, and those of DiskState, DeliveryQueue, DeliveredImages and FarmSignals.
struct FarmTables {
  FarmTables(const Limits& limits, uint64_t first_lease_id, uint64_t merge_bytes_max)
      : merge_budget(merge_bytes_max), scheduler(limits, first_lease_id) {}

  // Errors: kNotFound.
  absl::StatusOr<const JobRecord*> FindJob(uint64_t job_id) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);
  // Dates jobs that the scheduler has just ended, failures and quarantines, and frees the memory of
  // incomplete frames. Call it under the lock that ended them, so that nobody sees an ended job
  // without its time.
  void NoteEndedJobs() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);

  // Opens the frame if it is not open. on_disk: as OpenFrame has it. Requires: it has tasks.
  std::shared_ptr<OpenFrame> Open(const FrameId& id, const std::set<uint32_t>& on_disk = {})
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);
  // Makes Open cheap: allocates the frame's memory before the lock is taken. Does nothing for a
  // frame that has no tasks.
  void PrepareOpen(const FrameId& id) ABSL_LOCKS_EXCLUDED(mutex);

  // Null where the frame has no rounds.
  const RoundRecord* LastRoundOf(const FrameId& id) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);
  // Returns the frame's rounds.
  const std::vector<RoundRecord>& AddRound(const FrameId& id, RoundRecord record)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);

  // Since the frame's or job's first lease, in this life and earlier ones. Pauses and the time
  // after the job's end do not count.
  absl::Duration WallOf(const FrameId& id, SteadyTime now) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);
  absl::Duration WallOfJob(const JobRecord& job, SteadyTime now) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);

  // A frame's samples; where a stop rule decides, as far as it is foreseen.
  uint64_t SamplesExpected(const FrameId& id, const FrameRecord& frame) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);
  // The work for the workers of a profile; some tenths of a second old.
  const FarmLoad& LoadOf(const std::string& numeric_profile, SteadyTime now)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);

  MergeBudget merge_budget;
  Mutex prepare_mutex ABSL_ACQUIRED_BEFORE(mutex);  // One frame's memory is allocated at a time.

  Mutex mutex;
  Scheduler scheduler ABSL_GUARDED_BY(mutex);
  std::map<uint64_t, JobAccount> accounts ABSL_GUARDED_BY(mutex);
  std::map<FrameId, OpenEntry> open_frames ABSL_GUARDED_BY(mutex);
  // Live pilots, and when somebody last asked for them.
  std::map<uint64_t, std::chrono::steady_clock::time_point> pilots_asked ABSL_GUARDED_BY(mutex);
  std::vector<uint64_t> unsettled_jobs ABSL_GUARDED_BY(mutex);  // Ended, but not written down.
  // Jobs with failures that are not yet written down.
  std::set<uint64_t> unsaved_failures ABSL_GUARDED_BY(mutex);
  // Task failures that changed and are not yet written down.
  std::map<TaskId, TaskTrouble> unsaved_troubles ABSL_GUARDED_BY(mutex);
  // Identities that made false results, whose parts are still to be removed.
  std::vector<std::string> liars ABSL_GUARDED_BY(mutex);
  // Frames with parts that were made with another guiding field than a new one, still to be
  // removed.
  std::set<FrameId> stale_fields ABSL_GUARDED_BY(mutex);
  std::vector<QuarantineRecord> unsaved_quarantines ABSL_GUARDED_BY(mutex);  // Likewise.
  // By numeric profile, as they were at loads_time.
  std::map<std::string, FarmLoad> loads ABSL_GUARDED_BY(mutex);
  SteadyTime loads_time ABSL_GUARDED_BY(mutex);

 private:
  // The frame where it can be opened and is not; null otherwise.
  const FrameRecord* ToOpen(const FrameId& id) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);
  uint64_t FirstPointOf(const FrameId& id) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);
  // The wall time in this life, of a frame or a job that was first leased then.
  absl::Duration WallSince(uint64_t job_id, SteadyTime first_lease_time, SteadyTime now) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);
};

}  // namespace sheaf::coordinator
