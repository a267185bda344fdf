// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CostForecast: what a frame will cost by the time that its error is at a target, from what is
// known of its tiles. It plays the frame's rounds through (sample_rounds.h) with errors as a model
// gives them, so that what rounds add, their margins and their last steps, is in the price:
//
//     tiles, their errors and CPU time > model > DecideRound, again and again > Forecast
//
// The model: a tile's squared error falls as 1 / n^b from what it was measured at, with one b for
// the frame, and a sample of a tile costs what those before it did.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "coordinator/core/sample_rounds.h"

namespace sheaf::coordinator {

struct ForecastTile {
  TileRound measured;
  double cpu_seconds_per_sample = 0;  // Of one sample of each of the tile's pixels.
};

struct ErrorModel {
  std::vector<ForecastTile> tiles;
  double rate = 1;  // b.
  // log-normal standard deviation of the frame's error as measured, and of b: what is not known.
  double log_error_deviation = 0, rate_deviation = 0;
  double log_cpu_deviation = 0;  // Of CPU time, for the same samples.
};

struct Forecast {
  double target_error = 0;
  bool reached = false;  // Before samples_max.
  double relative_mse = 0;
  double samples = 0;  // Of a pixel, on average.
  double cpu_seconds = 0;
  int round_count = 0;
};

// From the first round on. `deviations`: how many of the model's standard deviations the errors lie
// above it. Requires: tiles, with samples, and a target.
Forecast ForecastTarget(const ErrorModel& model, const StopRule& rule, uint64_t samples_max,
                        double deviations = 0);
// With so many samples in every pixel.
Forecast ForecastSamples(const ErrorModel& model, uint64_t samples, double deviations = 0);

}  // namespace sheaf::coordinator
