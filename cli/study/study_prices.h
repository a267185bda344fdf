// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The yield of the given settings for a number of samples or a time, from the measured curve of a
// study. Pure functions.
#pragma once

#include <optional>
#include <string>

#include "cli/study/study_analysis.h"

namespace sheaf::cli {

// The farm that a study names prices for. It renders nothing for the study.
struct StudyFarm {
  std::string address;
  int worker_count = 0, thread_count = 0;  // Those that take work.
  int other_job_count = 0;                 // Unfinished jobs, which prices leave out.
};

// The whole image at some number of samples per pixel.
struct StudyPrice {
  double samples = 0, cpu_seconds = 0;
  // Interpolated between the measured points; nullopt if none was measured.
  std::optional<Estimate> relative_mse;
};

// The error for this many samples: on the line between the two measured points, and beyond the
// first and last one along the curve's rate (1 if unknown). nullopt without points.
std::optional<Estimate> ErrorAt(const StudyCurve& curve, double samples);
// Wall time of this CPU time on `threads` threads. Requires: threads > 0.
double WallSecondsOn(int threads, double cpu_seconds);
// The samples per pixel that these threads render in a time, after work of training_cpu_seconds; 0
// if the time is too short for that. Requires: seconds, threads and cpu_seconds_per_sample are
// above 0.
double SamplesIn(double seconds, int threads, double cpu_seconds_per_sample,
                 double training_cpu_seconds = 0);

}  // namespace sheaf::cli
