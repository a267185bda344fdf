// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Quote: the forecast cost of a job for each of several target errors. A pilot of few pixels is
// rendered on the farm, as a job of highest priority:
//
//     pilot job > images > FitErrorModel > ForecastTarget for each error > Quote
//
// For a range of frames, pilots of a few frames are rendered and the others are interpolated. For a
// frame that continues from an image (--resume-from), errors are taken from the image, and the
// price covers the remaining work. For a frame with --denoise, further rows have the cost of the
// errors in the denoised layer (denoised_errors.h).
//
// The price of a stereo frame, or of one whose pixels share paths, is that of paths of one pixel
// times what two small images tell (sharing_pilot.h); a target holds for the worse eye.
//
// The price of a frame with light paths includes its light passes, and that of a guided frame its
// training (cost_forecast.h).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "cli/job/farm_client.h"
#include "cli/job/prepared_job.h"
#include "cli/quote/denoised_errors.h"
#include "coordinator/forecast/cost_forecast.h"
#include "coordinator/forecast/work_ahead.h"

namespace sheaf::cli {

// An estimate with a band that contains the true value in 8 of 10 cases.
using Banded = coordinator::Estimate;

struct QuoteRow {
  double target_error = 0;                     // 0: samples or minutes are given instead.
  std::optional<uint64_t> samples_given = {};  // Per pixel.
  double minutes_given = 0;                    // Wall time.
  // The denoised layer's; target_error is then the image error that it requires. 0: not denoised.
  double denoised_error = 0;
  // Within the limit of samples per pixel; or, if minutes are given, with any error quoted.
  bool reached = true;
  Banded relative_mse;
  Banded samples;  // Final samples per pixel, the mean over pixels and frames.
  // For all frames. wall: includes the farm's other jobs in that time; 0 if there are no workers.
  Banded cpu_seconds, wall_seconds;
};

struct Quote {
  int32_t width_px = 0, height_px = 0;
  double paths_per_pass = 0;  // Light paths of a pass; 0: there are no light passes.
  int frame_count = 1, pilot_frame_count = 1;
  double rate = 1, rate_deviation = 0;  // For the first frame; errors fall as 1 / n^rate.
  int thread_count = 0;                 // The farm's present threads.
  int jobs_before = 0;                  // Active jobs of equal or higher priority.
  coordinator::FarmLoad load;           // Includes those jobs.
  double pilot_cpu_seconds = 0;
  double training_cpu_seconds = 0;  // For all frames; a part of each row's. 0: no training.
  // If it continues from an image: its mean samples per pixel so far, and its light passes.
  struct Start {
    double samples = 0, relative_mse = 0, light_passes = 0;
  };
  std::optional<Start> start;
  // SharingGain, for frames whose paths count in several pixels.
  struct Sharing {
    double error_ratio = 1, cpu_ratio = 1;
    bool is_stereo = false;
  };
  std::optional<Sharing> sharing;
  std::optional<DenoisedPilot> denoised;  // If the frames have the denoised output.
  std::vector<QuoteRow> rows;
};

// The targets quoted when none is requested.
inline const std::vector<double> kQuotedErrors = {0.1, 0.05, 0.02, 0.01};
// The minutes for which the least error is quoted when none are requested.
inline const std::vector<double> kQuotedMinutes = {10};
// The errors that may be quoted for a time.
inline constexpr double kMinutesErrorMin = 1e-6, kMinutesErrorMax = 10;

struct QuoteArguments {
  std::vector<double> targets;       // Values of relMSE.
  std::vector<double> minutes = {};  // Wall times to quote errors for, if there are workers.
  bool with_samples = true;          // Also adds a row for the requested number of samples.
  absl::Duration wait_max = absl::InfiniteDuration();  // For all pilots together.
};

// Errors: those of the calls; kInvalidArgument if a frame cannot continue from its image, found
// before any pilot; kUnavailable if
// the pilot has not ended in time; kFailedPrecondition with the farm's message if it failed;
// kDataLoss if the coordinator does not report its cost. No pilot is left running on the farm after
// any error, including kCancelled.
absl::StatusOr<Quote> MakeQuote(FarmClient* client, const JobArguments& arguments,
                                const PreparedJob& job, const QuoteArguments& asked);

// An error and the time that an image takes to reach it.
struct ErrorTime {
  double error = 0, seconds = 0;  // relMSE.
};
// The least error that takes at most this many seconds: by power laws between the known ones, which
// fall in error, and as 1 / seconds beyond them, the rate of Monte Carlo. At least
// kMinutesErrorMin; nullopt if kMinutesErrorMax takes longer, or nothing is known.
std::optional<double> LeastErrorIn(double seconds, const std::vector<ErrorTime>& known);

// The row of a wall time, with the band of its error. targets: the rows of errors, which fall;
// training_cpu_seconds: the part of their prices that no error changes.
QuoteRow RowOfMinutes(double minutes, const std::vector<QuoteRow>& targets,
                      double training_cpu_seconds);

// A table for users of prices and results, with a line that states the basis of the forecast.
std::string FormatQuote(const Quote& quote);
std::string QuoteJson(const Quote& quote);

}  // namespace sheaf::cli
