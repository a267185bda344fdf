// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A frame that resumes a delivered image (resumed_image.h): checks that the image belongs to the
// frame, and derives the model for the cost of continuing from the samples and errors in the image:
//
//     FrameImage > ResumeImage > ImageStartOf > ErrorModel, with costs and rate from a pilot
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/exr/resumed_image.h"
#include "coordinator/core/cell_grid.h"
#include "coordinator/core/job.h"
#include "coordinator/forecast/cost_forecast.h"

namespace sheaf::coordinator {

// Prepares the image for continuing. spec: includes the frame digest. Errors: kInvalidArgument,
// with the reason why a frame of this spec and build cannot resume the image.
absl::StatusOr<ResumedImage> ResumeImage(FrameImage image, const FrameSpec& spec,
                                         const std::string& numeric_profile);

// Returns the samples and errors of the grid's cells. Errors: kInvalidArgument if the pixels of a
// cell have unequal samples, as in an image rendered with other tile or cell sizes.
absl::StatusOr<std::vector<CellRound>> ImageStartOf(const ResumedImage& resumed,
                                                    const CellGrid& grid);

// Replaces the errors and samples of the model by those of the image's cells. Errors of emitter
// silhouettes are removed, as the image includes them. Costs and the rate are kept. Requires: as
// many cells as the model has.
void ContinueFrom(const std::vector<CellRound>& cells, ErrorModel* model);

}  // namespace sheaf::coordinator
