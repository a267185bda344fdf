// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Turns a study's measurements into its results: error against time with error bars, rates, bias
// floors, gains, the Pareto front. Pure functions.
//
// Errors are relMSE against a reference, with the reference's own error subtracted. Pixels of one
// tile are correlated, so uncertainty is estimated from the spread over tiles: by the ratio
// estimator, and for fitted values by the bootstrap over tiles. Sources: Cochran 1977, Sampling
// Techniques, sec. 2.11; Efron 1979, "Bootstrap Methods: Another Look at the Jackknife".
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cli/study/study_ladder.h"

namespace sheaf::cli {

// The state of a setting's image after some number of samples.
struct StudyCheckpoint {
  double samples = 0;      // Per pixel; the mean if tiles differ.
  double cpu_seconds = 0;  // For the whole image.
  // By tile, summed over its pixels: the squared error against the truth, and the expected
  // variance, which is the part of it estimated from the spread of replicates.
  std::vector<double> error, variance;
};

// The measurements of one setting, in ascending order of samples.
struct StudyMeasurement {
  StudySetting setting;
  std::vector<StudyCheckpoint> checkpoints;
  // Relative standard error of the ratio of its CPU time to the base's, from the spread over turns.
  double time_deviation = 0;
};

// A number and its standard error.
struct Estimate {
  double value = 0, error = 0;
};

struct StudyPoint {
  double samples = 0, cpu_seconds = 0;
  Estimate relative_mse;
  // No point of a setting that renders the same image has a smaller error in less time; false for
  // biased settings.
  bool on_pareto_front = false;
};

struct StudyCurve {
  StudySetting setting;
  std::vector<StudyPoint> points;  // Points whose error differs from 0.
  std::optional<Estimate> rate;    // Exponent of the variance, which falls as 1 / samples^rate.
  // MSE = bias^2 + variance: the error that remains for any number of samples. nullopt with one
  // sequence, whose variance is unknown.
  std::optional<Estimate> bias_floor;
  // CPU time of the base over this setting's time to reach the error of its last point; nullopt if
  // the base's curve does not come close to that error.
  std::optional<Estimate> gain;

  bool HasBias() const { return bias_floor && bias_floor->value > 3 * bias_floor->error; }
};

// Relative standard error of the ratio of the sums of `over` and `under`, which are correlated:
// from the spread of their ratios.
double RatioDeviation(const std::vector<double>& over, const std::vector<double>& under);

// pixel_counts: by tile. The first measurement is the base.
std::vector<StudyCurve> AnalyzeStudy(const std::vector<StudyMeasurement>& measurements,
                                     const std::vector<double>& pixel_counts);

}  // namespace sheaf::cli
