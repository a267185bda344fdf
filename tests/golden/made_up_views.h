// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Views in which each field has a value of its own, so that a field that is lost or exchanged shows
// in a golden file.
#pragma once

#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {

FrameSettings MadeUpSettings();
// A job of two frames: a delivered one with all fields set, and one that is unknown as far as
// possible.
JobView MadeUpJob();
WorkerView MadeUpWorker();
FailureView MadeUpFailure();
std::vector<JobEvent> MadeUpEvents();
RefinementPrices MadeUpPrices();
std::vector<ShareView> MadeUpShares();
std::vector<RemovalView> MadeUpRemovals();
UsageReport MadeUpUsage();
std::vector<MetricView> MadeUpMetrics();

}  // namespace sheaf::coordinator
