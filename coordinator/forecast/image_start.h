// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A frame that resumes a delivered image (resumed_image.h): whether the image is of the
// frame, and what it tells of the frame, for the cost of continuing:
//
//     FrameImage > ResumeImage > ImageStartOf > ErrorModel, whose costs and rate a pilot told
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/exr/resumed_image.h"
#include "coordinator/core/cell_grid.h"
#include "coordinator/core/job.h"
#include "coordinator/forecast/cost_forecast.h"

namespace sheaf::coordinator {

// spec: with its frame digest. Errors: kInvalidArgument, which say why a frame of this spec and
// build cannot resume the image.
absl::StatusOr<ResumedImage> ResumeImage(FrameImage image, const FrameSpec& spec,
                                         const std::string& numeric_profile);

// The samples and errors of the grid's cells. Errors: kInvalidArgument where pixels of a cell have
// unequal samples: the image was rendered in tiles or cells of another size.
absl::StatusOr<std::vector<CellRound>> ImageStartOf(const ResumedImage& resumed,
                                                    const CellGrid& grid);

// The model of the frame from there on: all its pixels are known, emitters and their silhouettes
// with them. Its costs and its rate stay. Requires: as many cells as the model has.
void ContinueFrom(const std::vector<CellRound>& cells, ErrorModel* model);

}  // namespace sheaf::coordinator
