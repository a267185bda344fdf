// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CostForecast: what a frame will cost by the time that its error is at a target, from what is
// known of its cells. It plays the frame's rounds through (sample_rounds.h) with errors as a model
// gives them, so that what rounds add, their margins and their last steps, is in the price:
//
//     cells, their errors and CPU time > model > DecideRound, again and again > Forecast
//
// The model: a cell's squared error falls as 1 / n^b from what it was measured at, with one b for
// the frame, and a sample of a cell costs what those before it did.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "coordinator/core/sample_rounds.h"
#include "coordinator/forecast/emitter_silhouettes.h"

namespace sheaf::coordinator {

struct ForecastCell {
  CellRound measured;
  double cpu_seconds_per_sample = 0;  // For one sample of each of the cell's pixels.
  uint64_t samples_kept = 0;          // Per pixel; they exist already and cost nothing.
};

struct ErrorModel {
  std::vector<ForecastCell> cells;
  double rate = 1;  // b.
  // log-normal standard deviation of the frame's error as measured, and of b: what is not known.
  double log_error_deviation = 0, rate_deviation = 0;
  double log_cpu_deviation = 0;         // Deviation of CPU time, for the same samples.
  EmitterSilhouettes silhouettes = {};  // Their additions to the cells' errors.
};

struct Forecast {
  double target_error = 0;
  bool reached = false;  // Before samples_max.
  double relative_mse = 0;
  double samples = 0;      // Per pixel, on average.
  double cpu_seconds = 0;  // Beyond what is kept.
  int round_count = 0;
};

// Deviations from the mean within which 8 of 10 values of a normal distribution lie.
inline constexpr double kBandDeviations = 1.2816;
// A value and its band, in which 8 of 10 lie.
struct Estimate {
  double value = 0, low = 0, high = 0;
};
// low and high: as forecast so many deviations below and above. They are spread further by an
// independent log-normal deviation of the value itself. 0 where the value is.
Estimate WithBand(double value, double low, double high, double log_deviation);

// From the first round on, which has the samples that are kept where these are more. `deviations`:
// how many of the model's standard deviations the errors lie
// above it. Requires: cells, with samples, and a target.
Forecast ForecastTarget(const ErrorModel& model, const StopRule& rule, uint64_t samples_max,
                        double deviations = 0);
// Where a frame continues: the samples of each cell in the round that comes next, that round's
// number and how the cells were at the end of the one before.
struct ForecastStart {
  int round = 0;
  std::vector<uint64_t> samples;
  std::vector<CellRound> before;
};
// The same from there on.
Forecast ForecastFrom(const ErrorModel& model, const StopRule& rule, uint64_t samples_max,
                      ForecastStart start, double deviations = 0);
// With so many samples in every pixel.
Forecast ForecastSamples(const ErrorModel& model, uint64_t samples, double deviations = 0);

}  // namespace sheaf::coordinator
