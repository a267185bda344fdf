// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// From what a study measured to what it says: error against time with error bars, rates, bias
// floors, gains, the Pareto front. Pure functions.
//
// Errors are relMSE against a reference, less the reference's own. Pixels of a tile are alike, so
// chance is told by the spread over tiles: by the ratio estimator, and of what is fitted by the
// bootstrap over tiles. Sources: Cochran 1977, Sampling Techniques, sec. 2.11; Efron 1979,
// "Bootstrap Methods: Another Look at the Jackknife".
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cli/study/study_ladder.h"

namespace sheaf::cli {

// Of the picture of a setting after some samples.
struct StudyCheckpoint {
  double samples = 0;      // Of a pixel; on average where tiles differ.
  double cpu_seconds = 0;  // Of the whole picture.
  // Of each tile, summed over its pixels: the squared error against the truth, and of that the
  // expected variance, which the spread of replicates tells.
  std::vector<double> error, variance;
};

// What was measured of one setting, in ascending order of samples.
struct StudyMeasurement {
  StudySetting setting;
  std::vector<StudyCheckpoint> checkpoints;
  // Relative standard error of its CPU time over the base's, by the spread over turns.
  double time_deviation = 0;
};

// A number and its standard error.
struct Estimate {
  double value = 0, error = 0;
};

struct StudyPoint {
  double samples = 0, cpu_seconds = 0;
  Estimate relative_mse;
  bool on_front = false;  // No other point has less error for less time.
};

struct StudyCurve {
  StudySetting setting;
  std::vector<StudyPoint> points;  // Those whose error is told from 0.
  std::optional<Estimate> rate;    // Of the variance: errors fall as 1 / samples^rate.
  // MSE = bias^2 + variance: what no number of samples takes away. None with one sequence, whose
  // variance is not told.
  std::optional<Estimate> bias_floor;
  // CPU time of the base over this one's to the error of its last point; none where the base's
  // curve does not come near.
  std::optional<Estimate> gain;

  bool HasBias() const { return bias_floor && bias_floor->value > 3 * bias_floor->error; }
};

// Relative standard error of the sum of `over` over that of `under`, which vary together: by the
// spread of their ratios.
double RatioDeviation(const std::vector<double>& over, const std::vector<double>& under);

// pixel_counts: of each tile. The first measurement is the base.
std::vector<StudyCurve> AnalyzeStudy(const std::vector<StudyMeasurement>& measurements,
                                     const std::vector<double>& pixel_counts);

}  // namespace sheaf::cli
