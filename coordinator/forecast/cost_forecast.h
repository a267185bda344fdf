// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CostForecast: forecasts the samples and the CPU time that a frame takes to reach a target error,
// given the measured errors and costs of its cells. It simulates the frame's rounds
// (sample_rounds.h) with errors from a model, so that the price includes the overhead of rounds:
// their safety margins and the last, shortened step:
//
//     errors and CPU time of cells > ErrorModel > DecideRound, repeated > Forecast
//
// The model: a cell's squared error falls as 1 / n^b from its measured value, with one exponent b
// for the frame, and each further sample of a cell costs as much as its earlier samples.
//
// In a frame with light paths, the noise of its light passes adds to the error of each cell. There
// are as many passes as the cell with the most samples has (task_kind.h), and light passes are
// independent, so their errors fall as 1 / n. A guided frame also has a training, which costs the
// same for any number of samples.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "coordinator/core/frame/sample_rounds.h"
#include "coordinator/forecast/emitter_silhouettes.h"

namespace sheaf::coordinator {

struct ForecastCell {
  CellRound measured;
  double cpu_seconds_per_sample = 0;  // For one sample of each of the cell's pixels.
  uint64_t samples_kept = 0;          // Per pixel; these samples exist and cost nothing.
};

// The light passes of a frame.
struct LightModel {
  uint64_t passes = 0;              // Passes behind `errors`; 0: the frame has none.
  std::vector<ErrorSums> errors;    // By cell: the errors that light passes add to the camera's.
  double log_error_deviation = 0;   // As in ErrorModel.
  double cpu_seconds_per_pass = 0;  // For the whole frame.
  uint64_t passes_kept = 0;         // They exist and cost nothing.
};

struct ErrorModel {
  std::vector<ForecastCell> cells;
  double rate = 1;  // b.
  // Uncertainty of the model: the log-normal standard deviation of the frame's measured error, and
  // the standard deviation of b.
  double log_error_deviation = 0, rate_deviation = 0;
  double log_cpu_deviation = 0;         // Log-normal deviation of the CPU time of given samples.
  EmitterSilhouettes silhouettes = {};  // Their additional errors, by cell.
  LightModel light = {};
  double training_cpu_seconds = 0;  // 0: the frame has no training.
};

struct Forecast {
  double target_error = 0;
  bool reached = false;  // Whether the target is reached with at most samples_max.
  double relative_mse = 0;
  double samples = 0;  // Per pixel, on average.
  double light_passes = 0;
  double cpu_seconds = 0;  // Excludes the samples and passes that are kept.
  int round_count = 0;
};

// A normal value lies within this many standard deviations of its mean in 8 of 10 cases.
inline constexpr double kBandDeviations = 1.2816;
// A value, and a band that contains the true value in 8 of 10 cases.
struct Estimate {
  double value = 0, low = 0, high = 0;
};
// Returns the value with a band. low, high: forecasts at kBandDeviations below and above the value.
// The band is widened by an independent log-normal deviation of the value itself. All are 0 if the
// value is 0.
Estimate WithBand(double value, double low, double high, double log_deviation);

// Returns the errors of pixels with two independent kinds of noise, given the errors of each.
ErrorSums AddIndependent(const ErrorSums& a, const ErrorSums& b);

// Forecasts a frame that starts with its first round. In that round each cell gets
// rule.first_round_samples, or its samples_kept if they are more. deviations: the distance of the
// assumed errors from the model's, in its standard deviations; positive means larger errors.
// Requires: cells with samples; a target.
Forecast ForecastTarget(const ErrorModel& model, const StopRule& rule, uint64_t samples_max,
                        double deviations = 0);
// The state from which a frame continues: the samples of each cell in the next round, the number of
// that round, and the state of the cells at the end of the round before it.
struct ForecastStart {
  int round = 0;
  std::vector<uint64_t> samples;
  std::vector<CellRound> before;
};
// Forecasts a frame that continues from `start`; otherwise like ForecastTarget.
Forecast ForecastFrom(const ErrorModel& model, const StopRule& rule, uint64_t samples_max,
                      ForecastStart start, double deviations = 0);
// Forecasts a frame with the same number of samples in every pixel, without rounds.
Forecast ForecastSamples(const ErrorModel& model, uint64_t samples, double deviations = 0);

}  // namespace sheaf::coordinator
