// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TaskReports: finds a task, with how it failed and what it is rendered from, so that people can
// render it again elsewhere (docs/failures.md).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "coordinator/core/job/job.h"
#include "coordinator/service/farm/state/farm_tables.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator {

struct TaskReport {
  FrameId frame;
  FrameSpec spec;
  std::string numeric_profile;
  uint32_t task = 0;         // The number of its tile in the frame.
  bool whole_frame = false;  // What failed is the frame; the task is one of it.
  TaskKind kind = TaskKind::kCamera;
  PixelRect tile;
  SampleBlock block;
  TileCells cells;
  std::string set_aside;                 // As TaskTrouble has it.
  std::vector<TaskFailure> failures;     // The words are the workers' own.
  std::optional<PartRow> guiding_field;  // Where the task is rendered with one.
};

// Thread safety: all members may be called concurrently.
class TaskReports {
 public:
  // Both must outlive the object.
  TaskReports(FarmTables* tables, JobStore* store) : tables_(*tables), store_(*store) {}

  // number: the frame, tile: the task's number. Without them, the first task that is set aside;
  // otherwise the first frame that was given up, then an error in a scene, then any other failure.
  // A task that is named need not have failed. Errors: kNotFound; kFailedPrecondition (its guiding
  // field is not kept); those of the store.
  absl::StatusOr<TaskReport> Find(uint64_t job_id, std::optional<int32_t> number,
                                  std::optional<uint32_t> tile) const;

 private:
  absl::StatusOr<TaskReport> Choose(uint64_t job_id, std::optional<int32_t> number,
                                    std::optional<uint32_t> tile) const;
  FarmTables& tables_;
  JobStore& store_;
};

}  // namespace sheaf::coordinator
