// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Quotes of frames whose paths count in several pixels: stereo frames and those with
// Technique::kSharing. They have no pilots of few pixels, as they are rendered whole. So their
// model is that of paths of one pixel from the scene's camera, times what two small images of the
// whole frame tell:
//
//     job > WithoutSharing > RenderPilots > ErrorModel of one camera
//     small image with sharing, small image without > SharingGain
//     both > ApplySharing > ErrorModel of the frame
//
// The error of a stereo frame is its worse eye's. Small images see less of what several points of
// the lens or times gain, since blur spans fewer of their pixels: with +views, prices are upper
// bounds where blur is wide.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "cli/job/farm_client.h"
#include "cli/job/prepared_job.h"
#include "cli/quote/pilot.h"
#include "common/base/steady_time.h"
#include "coordinator/forecast/cost_forecast.h"

namespace sheaf::cli {

// Ratios of a frame to one of paths of one pixel from one camera, with equal samples a pixel.
struct SharingGain {
  double error_ratio = 1;  // relMSE of the frame over that of the other.
  double cpu_ratio = 1;    // CPU time of the frame: for both eyes over one.
  double log_error_deviation = 0;
};

// The frame's settings for paths of one pixel, from the scene's camera.
FrameSettings WithoutSharing(FrameSettings settings);
PreparedJob WithoutSharing(PreparedJob job);

// The gain of two images with equal samples a pixel: 1 where either has no error or no cost.
SharingGain GainOf(const PilotOutput& shared, const PilotOutput& plain);

// Makes the model, of paths of one pixel, that of a frame with one cell.
void ApplySharing(const SharingGain& gain, coordinator::ErrorModel* model);

// Renders both small images of each of the frames, adds their cost, and changes the models. Returns
// the gain in the first frame. Errors: as MakeQuote. Requires: HasOneTile of the job's frames.
absl::StatusOr<SharingGain> MeasureSharing(FarmClient* client, const JobArguments& arguments,
                                           const PreparedJob& job, SteadyTime deadline,
                                           std::vector<PilotFrame>* frames);

}  // namespace sheaf::cli
