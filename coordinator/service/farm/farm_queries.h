// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FarmQueries: the farm's FarmView, answered by the parts that know.
#pragma once

#include <string>
#include <vector>

#include "coordinator/service/farm/intake/content_exchange.h"
#include "coordinator/service/farm/queries/farm_metrics.h"
#include "coordinator/service/farm/queries/frame_previews.h"
#include "coordinator/service/farm/queries/job_views.h"
#include "coordinator/service/farm/queries/refinement_pricing.h"
#include "coordinator/service/farm/queries/worker_views.h"
#include "coordinator/service/farm/state/disk_state.h"
#include "coordinator/service/farm/state/farm_signals.h"
#include "coordinator/service/farm/upkeep/disk_keeper.h"
#include "coordinator/service/farm/upkeep/scrubber.h"
#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {

// Thread safety: as FarmView.
class FarmQueries : public FarmView {
 public:
  // All must outlive the object.
  struct Parts {
    const JobViews& jobs;
    const WorkerViews& workers;
    const FramePreviews& previews;
    const RefinementPricing& pricing;
    const FarmMetrics& metrics;
    const DiskKeeper& keeper;
    const ContentExchange& content;
    const Scrubber* scrubber;    // Null if nothing is scrubbed.
    const ObjectStore* objects;  // Null if parts lie in the state directory.
    const DiskState& disk;
    const FarmSignals& signals;
  };
  explicit FarmQueries(const Parts& parts) : parts_(parts) {}

  std::vector<JobView> ListJobs() const override { return parts_.jobs.List(); }
  absl::StatusOr<JobView> FindJob(const std::string& job_id) const override {
    return parts_.jobs.Find(job_id, /*with_frames=*/true);
  }
  absl::StatusOr<JobView> FindJobChanges(const std::string& job_id,
                                         FrameMarks* marks) const override {
    return parts_.jobs.FindChanges(job_id, marks);
  }
  absl::StatusOr<std::vector<FailureView>> ListFailures(const std::string& job_id) const override {
    return parts_.workers.ListFailures(job_id);
  }
  absl::StatusOr<std::vector<JobEvent>> ListEvents(const std::string& job_id) const override {
    return parts_.workers.ListEvents(job_id);
  }
  absl::StatusOr<RefinementPrices> PriceRefinement(
      const std::string& job_id, const std::vector<double>& target_errors) const override {
    return parts_.pricing.Price(job_id, target_errors);
  }
  std::vector<WorkerView> ListWorkers() const override { return parts_.workers.List(); }
  std::vector<MetricView> Metrics() const override;
  absl::StatusOr<PreviewView> Preview(const std::string& job_id, int32_t frame_number,
                                      const std::vector<std::string>& channels) const override {
    return parts_.previews.Preview(job_id, frame_number, channels);
  }
  absl::StatusOr<PreviewView> Thumbnail(const std::string& job_id,
                                        int32_t frame_number) const override {
    return parts_.previews.Thumbnail(job_id, frame_number);
  }
  absl::StatusOr<PreviewView> RoundPreview(const std::string& job_id, int32_t frame_number,
                                           int32_t round) const override {
    return parts_.previews.RoundPreview(job_id, frame_number, round);
  }
  std::vector<ReadyCondition> Conditions() const override;
  uint64_t ChangeCount() const override { return parts_.signals.ChangeCount(); }
  uint64_t WaitForChange(uint64_t seen, absl::Duration timeout) const override {
    return parts_.signals.WaitForChange(seen, timeout);
  }

 private:
  const Parts parts_;
};

}  // namespace sheaf::coordinator
