// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A frame that resumes a delivered image (resumed_image.h): checks that the image belongs to the
// frame, and derives the model for the cost of continuing from the samples and errors in the image:
//
//     FrameImage > ResumeImage > ImageStartOf > ErrorModel, with costs and rate from a pilot
//
// In a frame with light passes, each cell's error is divided between its camera samples and the
// light passes in proportion to the variance that each has left in its pixels, as the light layer
// of the image says (light_image.h).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/exr/resumed_image.h"
#include "coordinator/core/job/cell_grid.h"
#include "coordinator/core/job/job.h"
#include "coordinator/forecast/cost_forecast.h"

namespace sheaf::coordinator {

// Prepares the image for continuing. spec: includes the frame digest. Errors: kInvalidArgument,
// with the reason why a frame of this spec and build cannot resume the image.
absl::StatusOr<ResumedImage> ResumeImage(FrameImage image, const FrameSpec& spec,
                                         const std::string& numeric_profile);

// The samples and errors that a frame has which continues from an image.
struct ImageStart {
  std::vector<CellRound> cells;         // The camera's samples, and the errors that they have left.
  uint64_t light_passes = 0;            // 0: the frame has none.
  std::vector<ErrorSums> light_errors;  // By cell: those that light passes add; empty without them.

  // Samples per pixel of the camera, on average, and the error of the image as a whole.
  double SamplesPerPixel() const;
  double RelativeMse() const;
};

// Returns the samples and errors of the grid's cells. Errors: kInvalidArgument if the pixels of a
// cell have unequal samples, as in an image rendered with other tile or cell sizes.
absl::StatusOr<ImageStart> ImageStartOf(const ResumedImage& resumed, const CellGrid& grid);

// Replaces the errors and samples of the model by those of the image's cells, and the errors and
// number of its light passes by the image's. Errors of emitter silhouettes are removed, as the
// image includes them. Costs and the rate are kept. Requires: as many cells as the model has, and
// light passes if the model has them.
void ContinueFrom(const ImageStart& start, ErrorModel* model);

}  // namespace sheaf::coordinator
