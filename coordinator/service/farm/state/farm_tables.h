// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FarmTables: the tables of a farm that change together, under one mutex: the scheduler, and the
// state of jobs and open frames that the scheduler does not need. The classes of farm/ share it.
// The mutex is never held during work on a disk or an image.
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
  SteadyTime ended = SteadyTime::InfiniteFuture();  // The same, if since the start.
  std::map<int32_t, DeliveredFrame> delivered;
  // By frame. Cells of the last round only, and only of frames that are not delivered.
  std::map<int32_t, std::vector<RoundRecord>> rounds;
  std::map<int32_t, absl::Duration> wall_before;  // By frame: before this start.
  absl::Duration job_wall_before;                 // The same for the job as a whole.
  std::string warning;                            // StoredJob's; so are the next ones.
  std::map<int32_t, int32_t> corrections;
  bool pinned = false;
  absl::Time parts_removed_time = absl::InfiniteFuture();

  // Only ends since the coordinator started.
  bool EndedWithin(absl::Duration duration, SteadyTime now) const {
    return ended != SteadyTime::InfiniteFuture() && now - ended < duration;
  }
};

// An open frame and its state at its last refresh.
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
  // incomplete frames. Call it under the lock that ended them, so that no caller sees an ended job
  // without its time.
  void NoteEndedJobs() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);

  // Opens the frame if it is not open. on_disk: as in OpenFrame. Requires: it has tasks.
  std::shared_ptr<OpenFrame> Open(const FrameId& id, const std::set<uint32_t>& on_disk = {})
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);
  // Makes Open cheap: allocates the frame's memory before the lock is taken. Does nothing for a
  // frame that has no tasks.
  void PrepareOpen(const FrameId& id) ABSL_LOCKS_EXCLUDED(mutex);

  // Null if the frame has no rounds.
  const RoundRecord* LastRoundOf(const FrameId& id) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);
  // Returns the frame's rounds.
  const std::vector<RoundRecord>& AddRound(const FrameId& id, RoundRecord record)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);

  // Wall time since the frame's or job's first lease, over all runs of the coordinator. Pauses and
  // the time after the job's end do not count.
  absl::Duration WallOf(const FrameId& id, SteadyTime now) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);
  absl::Duration WallOfJob(const JobRecord& job, SteadyTime now) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);

  // A frame's samples; with a stop rule, the predicted number.
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
  // Live pilots, with the time of their last request.
  std::map<uint64_t, std::chrono::steady_clock::time_point> pilots_asked ABSL_GUARDED_BY(mutex);
  std::vector<uint64_t> unsettled_jobs ABSL_GUARDED_BY(mutex);  // Ended, but not yet stored.
  // Jobs with failures that are not yet stored.
  std::set<uint64_t> unsaved_failures ABSL_GUARDED_BY(mutex);
  // Task failures that changed and are not yet stored.
  std::map<TaskId, TaskTrouble> unsaved_troubles ABSL_GUARDED_BY(mutex);
  // Identities that made false results, whose parts are still to be removed.
  std::vector<std::string> liars ABSL_GUARDED_BY(mutex);
  // Frames with parts made with a guiding field other than the new one, still to be removed.
  std::set<FrameId> stale_fields ABSL_GUARDED_BY(mutex);
  std::vector<QuarantineRecord> unsaved_quarantines ABSL_GUARDED_BY(mutex);  // Likewise.
  // By numeric profile, as they were at loads_time.
  std::map<std::string, FarmLoad> loads ABSL_GUARDED_BY(mutex);
  SteadyTime loads_time ABSL_GUARDED_BY(mutex);

 private:
  // The frame if it can be opened and is not open; null otherwise.
  const FrameRecord* ToOpen(const FrameId& id) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);
  uint64_t FirstPointOf(const FrameId& id) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);
  // The wall time since the coordinator started, of a frame or a job first leased at
  // first_lease_time.
  absl::Duration WallSince(uint64_t job_id, SteadyTime first_lease_time, SteadyTime now) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex);
};

}  // namespace sheaf::coordinator
