// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Costs and gains of the effects of a job's scene, measured on this machine (MeasurePlan) to be
// stored with the job.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "cli/job/prepared_job.h"
#include "sheaf/v1/job.pb.h"

namespace sheaf::cli {

// Measures the first frame. Takes `seconds` plus the time to compile the scene. Requires: the
// frame's techniques have no light paths. Errors: those of ReadScene, ResolveSettings and
// MeasurePlan.
absl::StatusOr<std::vector<v1::EffectCost>> MeasureEffects(const JobArguments& arguments,
                                                           double seconds);

}  // namespace sheaf::cli
