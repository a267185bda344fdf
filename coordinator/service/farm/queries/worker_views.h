// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// WorkerViews: the state of workers, and failed leases.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/content/blob_store.h"
#include "coordinator/service/farm/state/farm_tables.h"
#include "coordinator/service/farm/state/job_journal.h"
#include "coordinator/service/farm/state/scene_names.h"
#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {

// The state in which a worker is shown.
WorkerState StateOf(const WorkerRecord& worker);

// Thread safety: all members may be called concurrently.
class WorkerViews {
 public:
  // All must outlive the object.
  WorkerViews(FarmTables* tables, const BlobStore* blobs, JobJournal* journal)
      : tables_(*tables), names_(blobs), journal_(*journal) {}

  // As in FarmView.
  std::vector<WorkerView> List() const;
  absl::StatusOr<std::vector<FailureView>> ListFailures(const std::string& job_id) const;
  absl::StatusOr<std::vector<JobEvent>> ListEvents(const std::string& job_id) const;

 private:
  WorkerView ViewOf(const WorkerRecord& worker) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);

  FarmTables& tables_;
  mutable SceneNames names_;
  JobJournal& journal_;
};

}  // namespace sheaf::coordinator
