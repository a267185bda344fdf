// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// JobViews: consistent copies of jobs and their frames in the tables.
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

  // As in Farm.
  std::vector<JobView> List() const;
  std::vector<JobView> ListWithPilots() const;
  absl::StatusOr<JobView> Find(const std::string& job_id, bool with_frames) const;
  // Returns only the frames whose marks differ from these, and updates the marks. A frame's mark
  // changes if users would see a change other than elapsed time.
  absl::StatusOr<JobView> FindChanges(const std::string& job_id, FrameMarks* marks) const;
  // Whether it exists and has not ended. Cheap.
  bool IsLive(const std::string& job_id) const;

 private:
  // marks: null: all frames.
  JobView ViewOf(const JobRecord& job, bool with_frames, FrameMarks* marks, SteadyTime now) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  FrameView ViewOf(const JobRecord& job, const FrameRecord& frame, bool with_spec,
                   SteadyTime now) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  // Jobs with smaller ids, newest first.
  std::vector<JobView> ListBelow(uint64_t job_id) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  // Estimates the time for the samples left in *progress, which belongs to the job or to one of its
  // frames.
  void EstimateRemaining(const JobRecord& job, SteadyTime now, ProgressView* progress) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  // Replaces a whole job's estimate by the forecast for all jobs of the farm, which has a band.
  void AddBand(const JobRecord& job, SteadyTime now, ProgressView* progress) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);

  const std::string state_directory_;
  FarmTables& tables_;
  const RoundPreviews& previews_;
  const DiskState& disk_;
};

}  // namespace sheaf::coordinator
