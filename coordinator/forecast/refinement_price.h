// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The cost of refining a finished frame until its error is at a target. Its rounds tell what a
// pilot would (pilot_model.h), but of all pixels: the errors of its cells, how they fell, and the
// cost of a sample of each cell. The frame continues where ReplayRounds would let it, and from
// there its rounds are played through:
//
//     rounds, CPU time of cells > where the new rule differs > ErrorModel > ForecastFrom > price
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "coordinator/forecast/cost_forecast.h"
#include "coordinator/forecast/work_ahead.h"

namespace sheaf::coordinator {

// Cells of more are priced in groups of cells that are alike.
inline constexpr size_t kPriceGroupsMax = 64;
// Frames of a job that are priced, evenly over its range.
inline constexpr size_t kPricedFramesMax = 3;
// Targets of one call.
inline constexpr size_t kPricedTargetsMax = 32;

// A frame that is delivered.
struct FinishedFrame {
  // Whether `rounds` were decided by a rule; else they are points of its curve, and it goes on from
  // the last.
  bool had_rule = false;
  uint64_t first_round_samples = kReplicateCount;  // As its rule has it.
  std::vector<RoundRecord> rounds;                 // With cells; at least one.
  // CPU time of all samples of each cell; empty where its parts are not kept, and all of them must
  // be rendered again.
  std::vector<double> cpu_seconds_of_cells;
  double cpu_seconds = 0;  // For the frame.
};

struct RefinementPrice {
  double target_error = 0;
  bool reached = false;        // With the samples that are allowed.
  Estimate relative_mse;       // In the end; this and the next as means over frames.
  Estimate samples_per_pixel;  // In the end, those included that are there.
  Estimate cpu_seconds;        // For all frames, beyond the samples that exist.
  Estimate wall_seconds;       // With the farm's other jobs; 0 where there are no threads.
};

// frames: some of a job's frame_count, evenly over its range. samples_max: of a pixel. priority:
// the job's. Requires: frames, and targets above 0.
std::vector<RefinementPrice> PriceRefinement(std::span<const FinishedFrame> frames,
                                             size_t frame_count,
                                             std::span<const double> target_errors,
                                             uint64_t samples_max, int32_t priority,
                                             const FarmLoad& load);

}  // namespace sheaf::coordinator
