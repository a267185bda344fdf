// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/quote.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "cli/duration.h"
#include "common/film/exr_codec.h"
#include "common/rpc/settings_codec.h"
#include "coordinator/core/pilot_model.h"

namespace sheaf::cli {
namespace {

using coordinator::ErrorModel;
using coordinator::Forecast;
using coordinator::kBandDeviations;
using coordinator::PilotLevel;
using coordinator::PilotPicture;
using coordinator::WithBand;

// Log-normal deviation of CPU time for the same work, of hours and of a pilot's milliseconds:
// processors share caches, memory and clocks. Measured over eight scenes on a busy machine.
constexpr double kCpuLogDeviation = 0.12;
// Of the price that is allowed, what is planned for: overheads come on top, and clocks differ by a
// third over a pilot's milliseconds on a busy machine.
constexpr double kPilotShareAim = 0.017;
// Below the error that pilots so far tell: what a further one is paid from, so that the price holds
// where they were wrong.
constexpr double kPriceDeviations = 2;
// A further pilot has so many times the samples of those before: no more, as one bright sample
// among few makes a scene seem dear, and the next pilot tells.
constexpr double kPilotGrowthMin = 0.4, kPilotGrowthMax = 2;
constexpr int kPilotCountMax = 6;
// Of the threads' time, what goes into samples.
constexpr double kFarmEfficiency = 0.95;
constexpr absl::Duration kPollInterval = absl::Milliseconds(30);
constexpr uint64_t kPilotBytesMax = uint64_t{4} << 30;

struct PilotFrame {
  size_t index = 0;  // In the job's frames.
  std::vector<PilotPicture> pictures;
  double cpu_seconds = 0;  // Of the pilot's pictures.
  ErrorModel model;
};

// Evenly over the range, its ends included.
std::vector<PilotFrame> ChooseFrames(size_t frame_count) {
  const size_t count = std::min<size_t>(frame_count, kQuotedFramesMax);
  std::vector<PilotFrame> frames(count);
  for (size_t i = 0; i < count; ++i) {
    frames[i].index = count == 1 ? 0 : i * (frame_count - 1) / (count - 1);
  }
  return frames;
}

// As the coordinator will have it.
coordinator::CellGrid GridOf(const JobArguments& arguments, const FrameSettings& settings) {
  const int32_t tile_size_px =
      arguments.tile_size_px != 0 ? arguments.tile_size_px : coordinator::Partition().tile_size_px;
  const int32_t cell_size_px = arguments.cell_size_px != 0
                                   ? arguments.cell_size_px
                                   : coordinator::ChooseCellSize(settings.window, tile_size_px);
  return {settings.window, tile_size_px, cell_size_px};
}

absl::StatusOr<PilotPicture> FetchPicture(FarmClient* client, const v1::Frame& frame,
                                          const PilotLevel& level, size_t tile_count) {
  const absl::StatusOr<std::string> bytes = client->ReadFrameOutput(frame.name(), kPilotBytesMax);
  if (!bytes.ok()) return bytes.status();
  absl::StatusOr<FramePicture> picture = DecodePicture(*bytes);
  if (!picture.ok()) return picture.status();
  PilotPicture pilot{level, *std::move(picture), {}};
  if (level.lattice.All()) return pilot;
  absl::StatusOr<std::vector<double>> times =
      coordinator::TileCpuSecondsOf(pilot.picture.metadata, tile_count);
  if (!times.ok()) return times.status();
  pilot.cpu_seconds_of_tiles = *std::move(times);
  return pilot;
}

absl::StatusOr<v1::Job> AwaitJob(FarmClient* client, const std::string& name, absl::Time deadline) {
  while (true) {
    const absl::StatusOr<v1::Job> job = client->GetJob(name);
    if (!job.ok()) return job.status();
    if (job->state() == v1::Job::STATE_SUCCEEDED) return job;
    if (HasEnded(*job)) {
      return absl::FailedPreconditionError(
          absl::StrCat("the quote's pilot failed: ", job->failure()));
    }
    if (absl::Now() > deadline) {
      return absl::UnavailableError(job->waiting_reason().empty() ? "the pilot takes too long"
                                                                  : job->waiting_reason());
    }
    absl::SleepFor(kPollInterval);
  }
}

// Leaves no job behind on the farm that nobody waits for.
absl::StatusOr<v1::Job> RunJob(FarmClient* client, const v1::CreateJobRequest& request,
                               absl::Time deadline) {
  absl::StatusOr<v1::Job> job = client->CreateJob(request);
  absl::StatusOr<v1::Job> ended = job.ok() ? AwaitJob(client, job->name(), deadline) : job.status();
  if (ended.ok()) return ended;
  const std::unique_ptr<FarmClient> last = client->Uninterrupted();
  // The answer was not waited for; by its id the same request makes the same job.
  if (absl::IsCancelled(job.status())) job = last->CreateJob(request);
  if (job.ok()) last->CancelJob(job->name()).IgnoreError();
  return ended;
}

// Of the same view, each length so many times smaller.
FrameSettings Shrunk(FrameSettings settings, int32_t shrink) {
  const auto length = [&](int32_t full) { return (full + shrink / 2) / shrink; };
  PixelRect& window = settings.window;
  const int32_t x0 = length(window.x0), y0 = length(window.y0);
  window = {x0, y0, std::max(x0 + 1, length(window.x1)), std::max(y0 + 1, length(window.y1))};
  settings.width_px = std::max(length(settings.width_px), window.x1);
  settings.height_px = std::max(length(settings.height_px), window.y1);
  return settings;
}

// Renders the levels of each frame, as one job.
absl::Status RenderPilot(FarmClient* client, const JobArguments& arguments, const PreparedJob& job,
                         const std::vector<std::vector<PilotLevel>>& levels, absl::Time deadline,
                         std::vector<PilotFrame>* frames) {
  PreparedJob pilot;
  for (size_t i = 0; i < frames->size(); ++i) {
    for (const PilotLevel& level : levels[i]) {
      PreparedFrame frame = job.frames[(*frames)[i].index];
      frame.number = static_cast<int>(pilot.frames.size()) + 1;
      frame.settings = Shrunk(frame.settings, level.shrink);
      frame.settings.samples = level.samples;
      frame.settings.lattice = level.lattice;
      if (level.lattice.All()) {
        frame.settings.outputs = {};
        frame.settings.outputs.AddLightPaths();
      }
      pilot.frames.push_back(std::move(frame));
    }
  }
  JobArguments pilot_arguments = arguments;
  // Pictures of a pair are of as many parts, so that what a part costs besides samples is told.
  pilot_arguments.pass_sample_count = coordinator::kPilotSamplesMax;
  pilot_arguments.stop = {};
  pilot_arguments.priority = kPilotPriority;
  pilot_arguments.title =
      absl::StrCat("quote of ", arguments.title.empty() ? arguments.scene : arguments.title);
  const absl::StatusOr<v1::Job> ended =
      RunJob(client, MakeCreateJobRequest(pilot_arguments, pilot), deadline);
  if (!ended.ok()) return ended.status();
  int next = 0;
  for (size_t i = 0; i < frames->size(); ++i) {
    PilotFrame& frame = (*frames)[i];
    const size_t tile_count = GridOf(arguments, job.frames[frame.index].settings).tiles().size();
    for (const PilotLevel& level : levels[i]) {
      const v1::Frame& rendered = ended->frames(next++);
      absl::StatusOr<PilotPicture> picture = FetchPicture(client, rendered, level, tile_count);
      if (!picture.ok()) return picture.status();
      frame.pictures.push_back(*std::move(picture));
      frame.cpu_seconds += Seconds(rendered.progress().cpu_duration());
    }
  }
  return absl::OkStatus();
}

void FitModels(const JobArguments& arguments, const PreparedJob& job,
               std::vector<PilotFrame>* frames) {
  for (PilotFrame& frame : *frames) {
    const PreparedFrame& prepared = job.frames[frame.index];
    frame.model = coordinator::FitErrorModel(GridOf(arguments, prepared.settings), frame.pictures,
                                             prepared.filter);
  }
}

// What a frame's next pilot is: at first what the first round allows, then as much more as the
// target is found to allow. Empty where that is not worth its while.
std::vector<PilotLevel> NextLevels(const PilotFrame& frame, const FrameSettings& settings,
                                   double target) {
  const int64_t pixel_count = settings.window.PixelCount();
  std::vector<PilotLevel> before;
  double samples_before = 0;
  for (const PilotPicture& picture : frame.pictures) {
    before.push_back(picture.level);
    samples_before += picture.level.SamplesPerPixel();
  }
  if (before.empty()) {
    return coordinator::PilotLevels(kPilotShareAim * kReplicateCount, pixel_count, settings.seed,
                                    before);
  }
  const Forecast cheapest = coordinator::ForecastTarget(frame.model, {.target_error = target},
                                                        kStoppedSamplesMax, -kPriceDeviations);
  const double spent = frame.cpu_seconds / cheapest.cpu_seconds;
  if (kPilotShareAim < (1 + kPilotGrowthMin) * spent) return {};
  const double allowed =
      std::min((kPilotShareAim - spent) * cheapest.samples, kPilotGrowthMax * samples_before);
  return coordinator::PilotLevels(allowed, pixel_count, settings.seed, before);
}

// Ever larger pilots, as long as the loosest target's price allows them.
absl::StatusOr<std::vector<PilotFrame>> RenderPilots(FarmClient* client,
                                                     const JobArguments& arguments,
                                                     const PreparedJob& job, double target,
                                                     absl::Time deadline) {
  std::vector<PilotFrame> frames = ChooseFrames(job.frames.size());
  for (int i = 0; i < kPilotCountMax; ++i) {
    std::vector<std::vector<PilotLevel>> levels;
    bool more = false;
    for (const PilotFrame& frame : frames) {
      levels.push_back(NextLevels(frame, job.frames[frame.index].settings, target));
      more |= !levels.back().empty();
    }
    if (!more) break;
    absl::Status status = RenderPilot(client, arguments, job, levels, deadline, &frames);
    if (!status.ok()) return status;
    FitModels(arguments, job, &frames);
  }
  return frames;
}

// Sum over all frames of what is known of some, linear in between. Requires: ascending indices.
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

// As MakeRow, for errors so many deviations above those of the models.
struct RowValues {
  double relative_mse = 0, samples = 0, cpu_seconds = 0;
  bool reached = true;
};
template <typename MakeForecast>
RowValues ValuesAt(const std::vector<PilotFrame>& frames, size_t frame_count,
                   const MakeForecast& make) {
  std::vector<double> errors, samples, cpu;
  RowValues values;
  for (const PilotFrame& frame : frames) {
    const Forecast forecast = make(frame.model);
    errors.push_back(forecast.relative_mse);
    samples.push_back(forecast.samples);
    cpu.push_back(forecast.cpu_seconds);
    values.reached &= forecast.reached;
  }
  const auto count = static_cast<double>(frame_count);
  values.relative_mse = SumOverFrames(frames, errors, frame_count) / count;
  values.samples = SumOverFrames(frames, samples, frame_count) / count;
  values.cpu_seconds = SumOverFrames(frames, cpu, frame_count);
  return values;
}

template <typename MakeForecast>
QuoteRow MakeRow(const std::vector<PilotFrame>& frames, size_t frame_count, int thread_count,
                 const MakeForecast& make) {
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
  if (thread_count > 0) {
    const double speed = thread_count * kFarmEfficiency;
    row.wall_seconds = {row.cpu_seconds.value / speed, row.cpu_seconds.low / speed,
                        row.cpu_seconds.high / speed};
  }
  return row;
}

absl::Status DescribeFarm(FarmClient* client, const JobArguments& arguments, Quote* quote) {
  constexpr size_t kJobsMax = 1000;
  const absl::StatusOr<std::vector<v1::Worker>> workers = client->ListWorkers();
  if (!workers.ok()) return workers.status();
  for (const v1::Worker& worker : *workers) {
    const bool works =
        worker.state() == v1::Worker::STATE_IDLE || worker.state() == v1::Worker::STATE_BUSY;
    if (works) quote->thread_count += worker.thread_count();
  }
  const absl::StatusOr<std::vector<v1::Job>> jobs = client->ListJobs(kJobsMax);
  if (!jobs.ok()) return jobs.status();
  for (const v1::Job& job : *jobs) {
    if (!HasEnded(job) && job.priority() >= arguments.priority) ++quote->jobs_before;
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Quote> MakeQuote(FarmClient* client, const JobArguments& arguments,
                                const PreparedJob& job, const QuoteArguments& asked) {
  Quote quote;
  if (absl::Status status = DescribeFarm(client, arguments, &quote); !status.ok()) return status;
  if (quote.thread_count == 0 && asked.wait_max != absl::InfiniteDuration()) {
    return absl::UnavailableError("no worker is connected");
  }
  const double loosest = *std::max_element(asked.targets.begin(), asked.targets.end());
  const absl::StatusOr<std::vector<PilotFrame>> frames =
      RenderPilots(client, arguments, job, loosest, absl::Now() + asked.wait_max);
  if (!frames.ok()) return frames.status();
  const FrameSettings& settings = job.frames.front().settings;
  quote.width_px = settings.window.Width();
  quote.height_px = settings.window.Height();
  quote.frame_count = static_cast<int>(job.frames.size());
  quote.pilot_frame_count = static_cast<int>(frames->size());
  quote.rate = frames->front().model.rate;
  quote.rate_deviation = frames->front().model.rate_deviation;
  for (const PilotFrame& frame : *frames) quote.pilot_cpu_seconds += frame.cpu_seconds;
  for (const double target : asked.targets) {
    QuoteRow& row = quote.rows.emplace_back(
        MakeRow(*frames, job.frames.size(), quote.thread_count,
                [&](const ErrorModel& model, double deviations) {
                  return coordinator::ForecastTarget(model, {.target_error = target},
                                                     kStoppedSamplesMax, deviations);
                }));
    row.target_error = target;
  }
  if (asked.with_samples && !arguments.stop.IsActive()) {
    const uint64_t samples = settings.samples;
    QuoteRow& row = quote.rows.emplace_back(
        MakeRow(*frames, job.frames.size(), quote.thread_count,
                [&](const ErrorModel& model, double deviations) {
                  return coordinator::ForecastSamples(model, samples, deviations);
                }));
    row.reached = true;
    row.samples_given = samples;
  }
  return quote;
}

}  // namespace sheaf::cli
