// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Quote: what a job will cost for each of some errors, before it runs. A pilot of few pixels is
// rendered on the farm, as a job that goes first:
//
//     pilot job > pictures > FitErrorModel > ForecastTarget for each error > Quote
//
// Of a range of frames a few have pilots, and what lies between them is interpolated. Of a frame
// that goes on from a picture (--resume-from) the errors are the picture's, and the price is of the
// rest.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "cli/job/farm_client.h"
#include "cli/job/prepared_job.h"
#include "coordinator/forecast/cost_forecast.h"
#include "coordinator/forecast/work_ahead.h"

namespace sheaf::cli {

// An estimate with a band that holds the truth in 8 of 10 cases.
using Banded = coordinator::Estimate;

struct QuoteRow {
  double target_error = 0;                // 0: samples are given.
  std::optional<uint64_t> samples_given;  // In every pixel.
  bool reached = true;                    // Within the most samples that a pixel may get.
  Banded relative_mse;
  Banded samples;  // Of a pixel, on average over pixels and frames, in the end.
  // For all frames. wall: with the farm's other jobs until then; 0 where there are no workers.
  Banded cpu_seconds, wall_seconds;
};

struct Quote {
  int32_t width_px = 0, height_px = 0;
  int frame_count = 1, pilot_frame_count = 1;
  double rate = 1, rate_deviation = 0;  // Errors fall as 1 / n^rate; of the first frame.
  int thread_count = 0;                 // Of the farm, now.
  int jobs_before = 0;                  // That go on, and go before it or beside it.
  coordinator::FarmLoad load;           // With those jobs.
  double pilot_cpu_seconds = 0;
  // Where it goes on from a picture: what that has, samples of a pixel on average.
  struct Start {
    double samples = 0, relative_mse = 0;
  };
  std::optional<Start> start;
  std::vector<QuoteRow> rows;
};

// What is quoted where nothing else is asked for.
inline const std::vector<double> kQuotedErrors = {0.1, 0.05, 0.02, 0.01};

struct QuoteArguments {
  std::vector<double> targets;  // Of relMSE.
  bool with_samples = true;     // Also a row for the samples that the job or its scene asks for.
  absl::Duration wait_max = absl::InfiniteDuration();  // For all pilots.
};

// Errors: those of the calls; kInvalidArgument where the frame cannot go on from its picture,
// before there is a pilot; kUnavailable where the pilot has not ended in time; kFailedPrecondition
// with the farm's message where it failed; kDataLoss where the coordinator does not tell its cost.
// No pilot is left running on the farm, whatever the error, kCancelled included.
absl::StatusOr<Quote> MakeQuote(FarmClient* client, const JobArguments& arguments,
                                const PreparedJob& job, const QuoteArguments& asked);

// A table for people, with a line of what it rests on.
std::string FormatQuote(const Quote& quote);
std::string QuoteJson(const Quote& quote);

}  // namespace sheaf::cli
