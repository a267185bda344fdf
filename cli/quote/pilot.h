// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Renders a quote's pilots on the farm as jobs of few pixels and fits a model of errors and costs
// to each frame. The size of the first pilot depends on what the first round of any target allows;
// later ones are larger, as far as the forecast for the requested target allows.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "cli/job/farm_client.h"
#include "cli/job/prepared_job.h"
#include "common/base/steady_time.h"
#include "common/film/frame_image.h"
#include "coordinator/forecast/image_start.h"
#include "coordinator/forecast/pilot_model.h"
#include "coordinator/forecast/zoomed_pilots.h"

namespace sheaf::cli {

struct PilotFrame {
  size_t index = 0;  // Among the job's frames.
  std::vector<coordinator::PilotImage> images;
  std::vector<coordinator::ZoomedPilot> zoomed_pilots;
  double cpu_seconds = 0;  // For all pilots.
  coordinator::ErrorModel model;
};

// Renders ever larger pilots of at most three frames, evenly spaced over the job's, while the price
// of `target`, the loosest target quoted, allows them. Returns the frames in ascending order.
// start: for a frame that continues from an image, or none; the image tells more about errors than
// a pilot could, so a single pilot measures only the costs. Errors: as MakeQuote.
absl::StatusOr<std::vector<PilotFrame>> RenderPilots(
    FarmClient* client, const JobArguments& arguments, const PreparedJob& job,
    const std::optional<coordinator::ImageStart>& start, double target, SteadyTime deadline);

// An image of a pilot, and what it cost.
struct PilotOutput {
  FrameImage image;
  double cpu_seconds = 0;
};
// Renders the job's frames as a pilot: before all other jobs, without its stop rule. Errors: as
// MakeQuote.
absl::StatusOr<std::vector<PilotOutput>> RenderAsPilot(FarmClient* client,
                                                       const JobArguments& arguments,
                                                       const PreparedJob& pilot,
                                                       SteadyTime deadline);

// The images of DenoisedCrops of the job's first frame, with the denoised layers; adds their CPU
// time to *cpu_seconds. Empty if the frame has no denoised output, or too few pixels.
absl::StatusOr<std::vector<FrameImage>> RenderDenoisedCrops(FarmClient* client,
                                                            const JobArguments& arguments,
                                                            const PreparedJob& job,
                                                            SteadyTime deadline,
                                                            double* cpu_seconds);

// The same cells as the coordinator will use.
coordinator::CellGrid GridOf(const JobArguments& arguments, const FrameSettings& settings);

}  // namespace sheaf::cli
