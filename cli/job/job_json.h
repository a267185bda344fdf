// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Messages of jobs and workers as JSON: that of their views (view_json.h), one object per line.
#pragma once

#include <string>

#include "sheaf/v1/job.pb.h"

namespace sheaf::cli {

// "queued", "running", "succeeded", "failed", "cancelled", "paused"; a state of a later version is
// its number.
std::string JobStateName(v1::Job::State state);
// "idle", "busy", "draining", "lost", "quarantined"; numbers as above.
std::string WorkerStateName(v1::Worker::State state);

std::string JobJson(const v1::Job& job);
std::string RefinementPricesJson(const v1::PriceRefinementResponse& response);
std::string WorkerJson(const v1::Worker& worker);
std::string EventJson(const v1::JobEvent& event);
std::string ShareJson(const v1::Share& share);

}  // namespace sheaf::cli
