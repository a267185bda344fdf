// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Renders a quote's pilots on the farm, as jobs of few pixels, and fits a model of errors and cost
// to each frame. The first goes by what the first round of any target allows; those after it have
// more, as far as the target that is asked for is found to allow it.
#pragma once

#include <cstddef>
#include <vector>

#include "absl/status/statusor.h"
#include "cli/job/farm_client.h"
#include "cli/job/prepared_job.h"
#include "common/base/steady_time.h"
#include "coordinator/forecast/lamp_close_ups.h"
#include "coordinator/forecast/pilot_model.h"

namespace sheaf::cli {

struct PilotFrame {
  size_t index = 0;  // In the job's frames.
  std::vector<coordinator::PilotPicture> pictures;
  std::vector<coordinator::CloseUp> close_ups;
  double cpu_seconds = 0;  // Of all of them.
  coordinator::ErrorModel model;
};

// Of at most three frames spread evenly over the job's, ascending, ever larger pilots as long as
// the price of `target`, the loosest that is quoted, allows them. start: of the cells of a frame
// that goes on from a picture, or empty; the picture tells more of errors than a pilot, which then
// tells costs, and there is but one. Errors: as MakeQuote.
absl::StatusOr<std::vector<PilotFrame>> RenderPilots(
    FarmClient* client, const JobArguments& arguments, const PreparedJob& job,
    const std::vector<coordinator::CellRound>& start, double target, SteadyTime deadline);

// As the coordinator will have it.
coordinator::CellGrid GridOf(const JobArguments& arguments, const FrameSettings& settings);

}  // namespace sheaf::cli
