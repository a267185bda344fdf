// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Estimates the cost of refining a finished frame until its error reaches a target. The frame's
// rounds contain the data that a pilot would provide (pilot_model.h), but for all pixels: the
// errors of its cells, how they fell, and the cost of a sample of each cell. The frame continues at
// the point that ReplayRounds chooses, and its rounds are simulated from there:
//
//     rounds, CPU time of cells > first differing decision > ErrorModel > ForecastFrom > price
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "coordinator/forecast/cost_forecast.h"
#include "coordinator/forecast/work_ahead.h"

namespace sheaf::coordinator {

// Frames with more cells are priced in groups of similar cells.
inline constexpr size_t kPriceGroupsMax = 64;
// At most this many frames of a job are priced, evenly spaced over its range.
inline constexpr size_t kPricedFramesMax = 3;
// Largest number of targets in one call.
inline constexpr size_t kPricedTargetsMax = 32;

// A delivered frame.
struct FinishedFrame {
  // Whether a stop rule decided `rounds`. Otherwise they are the points of the frame's error curve,
  // and the frame continues from the last of them.
  bool had_rule = false;
  uint64_t first_round_samples = kReplicateCount;  // From its stop rule.
  std::vector<RoundRecord> rounds;                 // With cells; at least one.
  // CPU time of all samples of each cell. Empty if the frame's parts are deleted, so that all
  // samples must be rendered again.
  std::vector<double> cpu_seconds_of_cells;
  double cpu_seconds = 0;  // CPU time of the whole frame.
};

struct RefinementPrice {
  double target_error = 0;
  bool reached = false;        // Whether the allowed samples suffice.
  Estimate relative_mse;       // Final; this and the next are means over frames.
  Estimate samples_per_pixel;  // Final, including existing samples.
  Estimate cpu_seconds;        // For all frames; excludes existing samples.
  // Includes the farm's other jobs; none if there are no threads.
  std::optional<Estimate> wall_seconds;
};

// Prices the refinement of a job for each target. frames: some of the job's frame_count frames,
// evenly spaced over its range. samples_max: per pixel. priority: that of the job. Requires: at
// least one frame; targets above 0.
std::vector<RefinementPrice> PriceRefinement(std::span<const FinishedFrame> frames,
                                             size_t frame_count,
                                             std::span<const double> target_errors,
                                             uint64_t samples_max, int32_t priority,
                                             const FarmLoad& load);

}  // namespace sheaf::coordinator
