// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RefinementPricing: the cost of refining a finished job.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "coordinator/forecast/refinement_price.h"
#include "coordinator/service/farm/state/farm_tables.h"
#include "coordinator/service/view/farm_view.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator {

// Thread safety: all members may be called concurrently.
class RefinementPricing {
 public:
  // Both arguments must outlive the object.
  RefinementPricing(FarmTables* tables, JobStore* store) : tables_(*tables), store_(*store) {}

  // As FarmView::PriceRefinement.
  absl::StatusOr<RefinementPrices> Price(const std::string& job_id,
                                         const std::vector<double>& target_errors) const;

 private:
  // A job that is priced, as it was in the tables.
  struct Priced;

  absl::Status Look(const std::string& job_id, const std::vector<double>& target_errors,
                    Priced* priced) const;
  absl::StatusOr<FinishedFrame> FinishedFrameOf(const FrameId& id, const FrameSpec& spec,
                                                const Partition& partition,
                                                const DeliveredFrame& delivered) const;

  FarmTables& tables_;
  JobStore& store_;
};

}  // namespace sheaf::coordinator
