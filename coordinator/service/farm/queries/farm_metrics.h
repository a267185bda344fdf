// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FarmMetrics: the counters and gauges of /metrics.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/service/farm/delivery/delivered_images.h"
#include "coordinator/service/farm/queries/user_metrics.h"
#include "coordinator/service/farm/queries/work_metrics.h"
#include "coordinator/service/farm/state/disk_state.h"
#include "coordinator/service/farm/state/farm_tables.h"
#include "coordinator/service/view/farm_view.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator {

// The state of a job: sums and extremes over its frames and their rounds.
struct JobCurve {
  double samples = 0, cpu_seconds = 0, part_bytes = 0;
  double relative_mse = 0, predicted_relative_mse = 0;
  double ratio_sum = 0;  // relMSE over predicted relMSE.
  int prediction_count = 0;
};

// Thread safety: all members may be called concurrently.
class FarmMetrics {
 public:
  // All pointers must outlive the object.
  FarmMetrics(std::string state_directory, FarmTables* tables, const JobStore* store,
              const DeliveredImages* images, const DiskState* disk)
      : state_directory_(std::move(state_directory)),
        tables_(*tables),
        store_(*store),
        images_(*images),
        disk_(*disk) {}

  // As in FarmView.
  std::vector<MetricView> List() const;
  // Memory of unfinished tiles and of certificates.
  uint64_t MergeBytes() const;

 private:
  struct LiveFigures {
    std::vector<std::pair<uint64_t, JobCurve>> jobs;  // The oldest first.
    size_t more_count = 0;                            // Further live jobs.
    JobCurve more;                                    // Their sums, without errors.
    std::map<std::string, UserFigures> users;
  };
  // The state of live jobs, count_max of them individually.
  LiveFigures ListLive(size_t count_max) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  // Sums over all live jobs that are not held.
  std::vector<LeasableWork> ListLeasable() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  // The state directory's disk; without its size if the system does not report it.
  std::vector<MetricView> ListDisk() const;

  const std::string state_directory_;
  FarmTables& tables_;
  const JobStore& store_;
  const DeliveredImages& images_;
  const DiskState& disk_;
};

}  // namespace sheaf::coordinator
