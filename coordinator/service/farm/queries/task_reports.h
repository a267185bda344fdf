// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TaskReports: finds a task with its failures and inputs, so that users can render it elsewhere
// (docs/failures.md).
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
  bool whole_frame = false;  // The frame failed; the task is one of its tasks.
  TaskKind kind = TaskKind::kCamera;
  PixelRect tile;
  SampleBlock block;
  TileCells cells;
  std::string set_aside;                 // As in TaskTrouble.
  std::vector<TaskFailure> failures;     // With the workers' own messages.
  std::optional<PartRow> guiding_field;  // If the task is rendered with one.
};

// Thread safety: all members may be called concurrently.
class TaskReports {
 public:
  // Both must outlive the object.
  TaskReports(FarmTables* tables, JobStore* store) : tables_(*tables), store_(*store) {}

  // number: the frame, tile: the task's number. Without them, finds the first task that is set
  // aside, else the first frame that was given up, else an error in a scene, else any other
  // failure. A named task need not have failed. Errors: kNotFound; kFailedPrecondition (its guiding
  // field is not kept); those of the store.
  absl::StatusOr<TaskReport> Find(uint64_t job_id, std::optional<int32_t> number,
                                  std::optional<uint32_t> tile) const;
  // The bytes of a report's guiding field. Errors: those of JobStore::ReadPart.
  absl::StatusOr<std::string> ReadField(const PartRow& field) const {
    return store_.ReadPart(field);
  }

 private:
  absl::StatusOr<TaskReport> Choose(uint64_t job_id, std::optional<int32_t> number,
                                    std::optional<uint32_t> tile) const;
  FarmTables& tables_;
  JobStore& store_;
};

}  // namespace sheaf::coordinator
