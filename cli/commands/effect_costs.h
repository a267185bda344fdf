// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What the effects of a job's scene cost and give, measured on this machine (MeasurePlan), for the
// job to carry.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "cli/job/prepared_job.h"
#include "sheaf/v1/job.pb.h"

namespace sheaf::cli {

// Of the first frame. Takes `seconds` and what compiling the scene takes.
// Errors: those of ReadScene, ResolveSettings and MeasurePlan.
absl::StatusOr<std::vector<v1::EffectCost>> MeasureEffects(const JobArguments& arguments,
                                                           double seconds);

}  // namespace sheaf::cli
