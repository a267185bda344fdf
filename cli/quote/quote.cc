// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/quote/quote.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "cli/duration.h"
#include "cli/quote/farm_size.h"
#include "cli/quote/pilot.h"
#include "cli/quote/sharing_pilot.h"
#include "common/base/status.h"
#include "common/film/exr/exr_codec.h"
#include "common/scene/settings/path_shares.h"

namespace sheaf::cli {
namespace {

using coordinator::ErrorModel;
using coordinator::Forecast;
using coordinator::ImageStart;
using coordinator::kBandDeviations;
using coordinator::WithBand;

// Log-normal deviation of the CPU time for the same work between a run of hours and a pilot's
// milliseconds: processors share caches, memory and clocks. Measured over eight scenes on a busy
// machine.
constexpr double kCpuLogDeviation = 0.12;

// Sum over all frames of values known for some of them, interpolated linearly. Requires: ascending
// indices.
double SumOverFrames(const std::vector<PilotFrame>& frames, const std::vector<double>& values,
                     size_t frame_count) {
  if (frames.size() == 1) return values[0] * static_cast<double>(frame_count);
  double sum = 0;
  for (size_t i = 0, right = 1; i < frame_count; ++i) {
    while (right + 1 < frames.size() && frames[right].index < i) ++right;
    const auto begin = static_cast<double>(frames[right - 1].index);
    const double span = static_cast<double>(frames[right].index) - begin;
    const double t = (static_cast<double>(i) - begin) / span;
    sum += (1 - t) * values[right - 1] + t * values[right];
  }
  return sum;
}

// The values of a row, as for MakeRow, at errors some number of deviations above the models'.
struct RowValues {
  double relative_mse = 0, samples = 0, light_passes = 0, cpu_seconds = 0;
  bool reached = true;
};
template <typename MakeForecast>
RowValues ValuesAt(const std::vector<PilotFrame>& frames, size_t frame_count,
                   const MakeForecast& make) {
  std::vector<double> errors, samples, passes, cpu;
  RowValues values;
  for (const PilotFrame& frame : frames) {
    const Forecast forecast = make(frame.model);
    errors.push_back(forecast.relative_mse);
    samples.push_back(forecast.samples);
    passes.push_back(forecast.light_passes);
    cpu.push_back(forecast.cpu_seconds);
    values.reached &= forecast.reached;
  }
  const auto count = static_cast<double>(frame_count);
  values.relative_mse = SumOverFrames(frames, errors, frame_count) / count;
  values.samples = SumOverFrames(frames, samples, frame_count) / count;
  values.light_passes = SumOverFrames(frames, passes, frame_count) / count;
  values.cpu_seconds = SumOverFrames(frames, cpu, frame_count);
  return values;
}

template <typename MakeForecast>
QuoteRow MakeRow(const std::vector<PilotFrame>& frames, const JobArguments& arguments,
                 const Quote& quote, const MakeForecast& make) {
  const auto frame_count = static_cast<size_t>(quote.frame_count);
  const auto at = [&](double deviations) {
    return ValuesAt(frames, frame_count,
                    [&](const ErrorModel& model) { return make(model, deviations); });
  };
  const RowValues values = at(0), low = at(-kBandDeviations), high = at(kBandDeviations);
  double log_cpu_deviation = 0;
  for (const PilotFrame& frame : frames) {
    log_cpu_deviation =
        std::max(log_cpu_deviation, std::hypot(kCpuLogDeviation, frame.model.log_cpu_deviation));
  }
  QuoteRow row;
  row.reached = values.reached;
  row.relative_mse = WithBand(values.relative_mse, low.relative_mse, high.relative_mse, 0);
  row.samples = WithBand(values.samples, low.samples, high.samples, 0);
  row.cpu_seconds =
      WithBand(values.cpu_seconds, low.cpu_seconds, high.cpu_seconds, log_cpu_deviation);
  const double samples_there = quote.start ? quote.start->samples : 0;
  const double pixels = static_cast<double>(quote.width_px) * quote.height_px;
  const double passes_there = quote.start ? quote.start->light_passes : 0;
  const double paths = pixels * (row.samples.value - samples_there) +
                       quote.paths_per_pass * (values.light_passes - passes_there);
  row.wall_seconds = coordinator::WallSeconds(row.cpu_seconds, paths * quote.frame_count,
                                              arguments.priority, quote.load);
  return row;
}

// Scales what exceeds `fixed`.
Banded Scaled(const Banded& value, double factor, double fixed = 0) {
  const auto scale = [&](double x) { return fixed + std::max(0.0, x - fixed) * factor; };
  return {scale(value.value), scale(value.low), scale(value.high)};
}

// The row of an error of the denoised layer: its price is that of an image with the error that may
// be denoised to it, and its band that of images with the bounds of this error.
QuoteRow DenoisedRow(double target, const std::vector<PilotFrame>& frames,
                     const JobArguments& arguments, const Quote& quote) {
  const Banded error = ImageErrorFor(target, *quote.denoised);
  const auto row_of = [&](double image_error) {
    return MakeRow(frames, arguments, quote, [&](const ErrorModel& model, double deviations) {
      return coordinator::ForecastTarget(model, {.target_error = image_error}, kStoppedSamplesMax,
                                         deviations);
    });
  };
  QuoteRow row = row_of(error.value);
  const QuoteRow cheapest = row_of(error.high), dearest = row_of(error.low);
  for (Banded QuoteRow::*banded :
       {&QuoteRow::samples, &QuoteRow::cpu_seconds, &QuoteRow::wall_seconds}) {
    (row.*banded).low = std::min((row.*banded).low, (cheapest.*banded).low);
    (row.*banded).high = std::max((row.*banded).high, (dearest.*banded).high);
  }
  row.target_error = error.value;
  row.denoised_error = target;
  return row;
}

coordinator::WorkLeft WorkLeftOf(const v1::Job& job) {
  const v1::Progress& progress = job.progress();
  const auto done = static_cast<double>(progress.sample_count_done());
  const auto total = static_cast<double>(progress.sample_count_total());
  const double cpu_seconds = Seconds(progress.cpu_duration());
  return {job.priority(), std::max(0.0, total - done), done > 0 ? cpu_seconds / done : 0};
}

absl::Status DescribeFarm(FarmClient* client, const JobArguments& arguments, Quote* quote) {
  const absl::StatusOr<std::vector<v1::Worker>> workers = client->ListWorkers();
  if (!workers.ok()) return workers.status();
  quote->thread_count = SizeOf(*workers, {}).thread_count;
  const absl::StatusOr<std::vector<v1::Job>> jobs = client->ListJobs(kLoadJobsMax);
  if (!jobs.ok()) return jobs.status();
  std::vector<coordinator::WorkLeft> left;
  for (const v1::Job& job : *jobs) {
    if (HasEnded(job) || job.state() == v1::Job::STATE_PAUSED) continue;
    if (job.priority() >= arguments.priority) ++quote->jobs_before;
    left.push_back(WorkLeftOf(job));
  }
  quote->load = {coordinator::kUsualThreadUse * quote->thread_count,
                 coordinator::WorkAhead(std::move(left))};
  return absl::OkStatus();
}

// The start of the job's frame, if it continues from an image.
absl::StatusOr<std::optional<ImageStart>> ReadStart(const JobArguments& arguments,
                                                    const PreparedJob& job) {
  if (arguments.resume_from.empty()) return std::nullopt;
  absl::StatusOr<FrameImage> image = ReadFrameImage(arguments.resume_from);
  if (!image.ok()) return image.status();
  const PreparedFrame& frame = job.frames.front();
  // The farm itself checks whether its build matches the image's.
  const std::string numeric_profile = image->metadata["numericProfile"];
  coordinator::FrameSpec spec;
  spec.scene = frame.manifest;
  spec.settings = frame.settings;
  spec.frame_digest = FrameDigest(frame.manifest.sha256_hex, frame.settings, numeric_profile);
  const std::string about = absl::StrCat("cannot continue from ", arguments.resume_from);
  const absl::StatusOr<ResumedImage> resumed =
      coordinator::ResumeImage(*std::move(image), spec, numeric_profile);
  if (!resumed.ok()) return Annotate(resumed.status(), about);
  absl::StatusOr<ImageStart> start =
      coordinator::ImageStartOf(*resumed, GridOf(arguments, frame.settings));
  if (!start.ok()) return Annotate(start.status(), about);
  return *std::move(start);
}

}  // namespace

std::optional<double> LeastErrorIn(double seconds, const std::vector<ErrorTime>& known) {
  if (known.empty() || !(seconds > 0)) return std::nullopt;
  // The first that takes longer, and the last that does not.
  const auto longer = std::find_if(known.begin(), known.end(),
                                   [&](const ErrorTime& at) { return at.seconds > seconds; });
  double error = 0;
  if (longer == known.begin()) {
    error = longer->error * longer->seconds / seconds;
  } else if (longer == known.end()) {
    error = known.back().error * known.back().seconds / seconds;
  } else {
    const ErrorTime &a = *(longer - 1), &b = *longer;
    const double share = std::log(seconds / a.seconds) / std::log(b.seconds / a.seconds);
    error = a.error * std::pow(b.error / a.error, share);
  }
  if (error > kMinutesErrorMax) return std::nullopt;
  return std::max(error, kMinutesErrorMin);
}

// A forecast for an error as low as ten minutes often reach would cost more than the whole quote.
QuoteRow RowOfMinutes(double minutes, const std::vector<QuoteRow>& targets,
                      double training_cpu_seconds) {
  const double seconds = 60 * minutes;
  // The least error, by the wall times after the training.
  const auto least = [&](double Banded::*bound) {
    std::vector<ErrorTime> known;
    double training = HUGE_VAL;
    for (const QuoteRow& row : targets) {
      if (!row.reached) continue;
      const double cpu = row.cpu_seconds.*bound, wall = row.wall_seconds.*bound;
      const double of_training = cpu > 0 ? wall * std::min(1.0, training_cpu_seconds / cpu) : 0;
      training = std::min(training, of_training);
      known.push_back({row.target_error, wall - of_training});
    }
    return LeastErrorIn(seconds - training, known);
  };
  QuoteRow row;
  const std::optional<double> error = least(&Banded::value);
  if (error) {
    const auto distance = [&](const QuoteRow& of) {
      return of.reached ? std::fabs(std::log(of.target_error / *error)) : HUGE_VAL;
    };
    const QuoteRow& near = *std::min_element(
        targets.begin(), targets.end(),
        [&](const QuoteRow& a, const QuoteRow& b) { return distance(a) < distance(b); });
    row.samples = Scaled(near.samples, near.target_error / *error);
    row.cpu_seconds = Scaled(near.cpu_seconds, near.target_error / *error, training_cpu_seconds);
    // A low time means a low error.
    row.relative_mse = {*error, std::min(*error, least(&Banded::low).value_or(*error)),
                        std::max(*error, least(&Banded::high).value_or(kMinutesErrorMax))};
  }
  row.reached = error.has_value();
  row.target_error = 0;
  row.minutes_given = minutes;
  row.wall_seconds = {seconds, seconds, seconds};
  return row;
}

absl::StatusOr<Quote> MakeQuote(FarmClient* client, const JobArguments& arguments,
                                const PreparedJob& job, const QuoteArguments& asked) {
  const FrameSettings& settings = job.frames.front().settings;
  if (MutatesPaths(settings.techniques)) {
    return absl::UnimplementedError("what frames with mutations cost is not predicted");
  }
  Quote quote;
  const absl::StatusOr<std::optional<ImageStart>> start = ReadStart(arguments, job);
  if (!start.ok()) return start.status();
  if (absl::Status status = DescribeFarm(client, arguments, &quote); !status.ok()) return status;
  if (quote.thread_count == 0 && asked.wait_max != absl::InfiniteDuration()) {
    return absl::UnavailableError("no worker is connected");
  }
  const double loosest = *std::max_element(asked.targets.begin(), asked.targets.end());
  const SteadyTime deadline = SteadyTime::Now() + asked.wait_max;
  const bool shares = HasOneTile(settings);
  absl::StatusOr<std::vector<PilotFrame>> frames = RenderPilots(
      client, arguments, shares ? WithoutSharing(job) : job, *start, loosest, deadline);
  if (!frames.ok()) return frames.status();
  if (shares) {
    const absl::StatusOr<SharingGain> gain =
        MeasureSharing(client, arguments, job, deadline, &*frames);
    if (!gain.ok()) return gain.status();
    quote.sharing = Quote::Sharing{gain->error_ratio, gain->cpu_ratio, settings.IsStereo()};
  }
  const absl::StatusOr<std::vector<FrameImage>> crops = RenderDenoisedCrops(
      client, arguments, job, SteadyTime::Now() + asked.wait_max, &quote.pilot_cpu_seconds);
  if (!crops.ok()) return crops.status();
  if (!crops->empty()) quote.denoised = DenoisedErrors(*crops);
  quote.width_px = settings.window.Width();
  quote.height_px = settings.window.Height();
  quote.frame_count = static_cast<int>(job.frames.size());
  quote.pilot_frame_count = static_cast<int>(frames->size());
  quote.rate = frames->front().model.rate;
  quote.rate_deviation = frames->front().model.rate_deviation;
  std::vector<double> trainings;
  for (const PilotFrame& frame : *frames) {
    quote.pilot_cpu_seconds += frame.cpu_seconds;
    trainings.push_back(frame.model.training_cpu_seconds);
  }
  quote.training_cpu_seconds = SumOverFrames(*frames, trainings, job.frames.size());
  if (HasLightPaths(settings.techniques)) {
    quote.paths_per_pass = static_cast<double>(coordinator::PathsPerLightPass(settings));
  }
  if (*start) {
    quote.start = Quote::Start{(*start)->SamplesPerPixel(), (*start)->RelativeMse(),
                               static_cast<double>((*start)->light_passes)};
  }
  for (const double target : asked.targets) {
    QuoteRow& row = quote.rows.emplace_back(
        MakeRow(*frames, arguments, quote, [&](const ErrorModel& model, double deviations) {
          return coordinator::ForecastTarget(model, {.target_error = target}, kStoppedSamplesMax,
                                             deviations);
        }));
    row.target_error = target;
  }
  if (quote.thread_count > 0) {
    std::vector<QuoteRow> falling = quote.rows;
    std::sort(falling.begin(), falling.end(),
              [](const QuoteRow& a, const QuoteRow& b) { return a.target_error > b.target_error; });
    for (const double minutes : asked.minutes) {
      quote.rows.push_back(RowOfMinutes(minutes, falling, quote.training_cpu_seconds));
    }
  }
  if (asked.with_samples && !arguments.stop.IsActive()) {
    const uint64_t samples = settings.samples;
    QuoteRow& row = quote.rows.emplace_back(
        MakeRow(*frames, arguments, quote, [&](const ErrorModel& model, double deviations) {
          return coordinator::ForecastSamples(model, samples, deviations);
        }));
    row.reached = true;
    row.samples_given = samples;
  }
  if (quote.denoised) {
    for (const double target : asked.targets) {
      quote.rows.push_back(DenoisedRow(target, *frames, arguments, quote));
    }
  }
  return quote;
}

}  // namespace sheaf::cli
