// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// JobViews: shows jobs and their frames: consistent copies of what the tables hold.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "coordinator/service/farm/state/disk_state.h"
#include "coordinator/service/farm/state/farm_tables.h"
#include "coordinator/service/view/farm_view.h"
#include "coordinator/store/round_previews.h"

namespace sheaf::coordinator {

// Thread safety: all members may be called concurrently.
class JobViews {
 public:
  // All pointers must outlive the object.
  JobViews(std::string state_directory, FarmTables* tables, const RoundPreviews* previews,
           const DiskState* disk)
      : state_directory_(std::move(state_directory)),
        tables_(*tables),
        previews_(*previews),
        disk_(*disk) {}

  // As Farm has them.
  std::vector<JobView> List() const;
  std::vector<JobView> ListWithPilots() const;
  absl::StatusOr<JobView> Find(const std::string& job_id, bool with_frames) const;
  // With those frames alone whose marks differ from these, which become the new ones. A frame's
  // mark differs where people would see a change, but for the time that passes.
  absl::StatusOr<JobView> FindChanges(const std::string& job_id, FrameMarks* marks) const;
  // Whether it is there and has not ended. Cheap.
  bool IsLive(const std::string& job_id) const;

 private:
  // marks: null: all frames.
  JobView ViewOf(const JobRecord& job, bool with_frames, FrameMarks* marks, SteadyTime now) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  FrameView ViewOf(const JobRecord& job, const FrameRecord& frame, bool with_spec,
                   SteadyTime now) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  // Those with smaller ids, newest first.
  std::vector<JobView> ListBelow(uint64_t job_id) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  // For the samples that are left in progress, which is the job's or one of its frames'.
  void EstimateRemaining(const JobRecord& job, SteadyTime now, ProgressView* progress) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  // Replaces that of a whole job by the forecast for all jobs of the farm, which has a band.
  void AddBand(const JobRecord& job, SteadyTime now, ProgressView* progress) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);

  const std::string state_directory_;
  FarmTables& tables_;
  const RoundPreviews& previews_;
  const DiskState& disk_;
};

}  // namespace sheaf::coordinator
