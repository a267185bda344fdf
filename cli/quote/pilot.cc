// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/quote/pilot.h"

#include <algorithm>
#include <chrono>
#include <map>
#include <memory>
#include <string>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "cli/duration.h"
#include "cli/progress_line.h"
#include "cli/quote/denoised_errors.h"
#include "cli/quote/shrunk_frame.h"
#include "common/film/denoised_output.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/light/light_image.h"
#include "common/rpc/settings_codec.h"
#include "coordinator/core/job/job.h"
#include "coordinator/core/job/limits.h"

namespace sheaf::cli {
namespace {

using coordinator::Forecast;
using coordinator::PilotImage;
using coordinator::PilotLevel;
using coordinator::ZoomedRegion;

// Planned cost of the pilots, as a fraction of the cost of the cheapest target. The limit is 3 %:
// overheads add to the plan, and clocks vary by a third over a pilot's milliseconds on a busy
// machine.
constexpr double kPilotFractionAim = 0.017;
// A further pilot is paid for by a price forecast this many deviations below the pilots' estimate
// of the error, so that the fraction holds even if that estimate was too high.
constexpr double kPriceDeviations = 2;
// Range of the samples of a further pilot, as a multiple of those before it. It grows slowly
// because one bright sample among few makes a scene seem expensive, and the next pilot corrects
// this.
constexpr double kPilotGrowthMin = 0.4, kPilotGrowthMax = 2;
constexpr int kPilotCountMax = 6;
// Fraction of the first pilot's samples for zoomed pilots of lights no larger than
// kZoomedPilotPixels pixels of the reduced image.
constexpr double kZoomedPilotFraction = 0.1, kZoomedPilotPixels = 4;
constexpr int kQuotedFramesMax = 3;
// A quote's pilot runs before all other jobs.
constexpr int32_t kPilotPriority = 1000;
constexpr absl::Duration kPollInterval = absl::Milliseconds(30);
constexpr std::chrono::seconds kWaitSilence{2};
constexpr uint64_t kPilotBytesMax = uint64_t{4} << 30;

// Without what camera paths learn before the first sample.
TechniqueSet WithoutTraining(TechniqueSet techniques) {
  return techniques.Without(Technique::kGuiding).Without(Technique::kLearnedLights);
}

// Evenly spaced over the range, both ends included.
std::vector<PilotFrame> ChooseFrames(size_t frame_count) {
  const size_t count = std::min<size_t>(frame_count, kQuotedFramesMax);
  std::vector<PilotFrame> frames(count);
  for (size_t i = 0; i < count; ++i) {
    frames[i].index = count == 1 ? 0 : i * (frame_count - 1) / (count - 1);
  }
  return frames;
}

absl::StatusOr<FrameImage> FetchImage(FarmClient* client, const v1::Frame& frame) {
  const absl::StatusOr<std::string> bytes = client->ReadFrameOutput(frame.name(), kPilotBytesMax);
  if (!bytes.ok()) return bytes.status();
  return DecodeFrameImage(*bytes);
}

absl::StatusOr<PilotImage> FetchPilot(FarmClient* client, const v1::Frame& frame,
                                      const PilotLevel& level, TechniqueSet techniques,
                                      size_t tile_count) {
  absl::StatusOr<FrameImage> image = FetchImage(client, frame);
  if (!image.ok()) return image.status();
  for (const LightLayerChannel& channel : LightLayerChannels({})) {
    if (!level.is_light_image || image->Find(channel.of_layer) != nullptr) continue;
    return absl::DataLossError(
        absl::StrCat("the pilot's image has no channel ", channel.of_layer,
                     ": the coordinator is of another version; use the client of its version"));
  }
  PilotImage pilot{level, *std::move(image), {}};
  const std::map<std::string, std::string>& metadata = pilot.image.metadata;
  if (!level.lattice.All()) {
    absl::StatusOr<std::vector<double>> times = coordinator::TileCpuSecondsOf(metadata, tile_count);
    if (!times.ok()) return times.status();
    pilot.cpu_seconds_of_tiles = *std::move(times);
  }
  const bool is_trained = !level.lattice.All() && NeedsTraining(techniques);
  for (const auto& [is_there, key, seconds] :
       {std::tuple{level.is_light_image, "lightCpuSeconds", &pilot.light_cpu_seconds},
        std::tuple{is_trained, "trainingCpuSeconds", &pilot.training_cpu_seconds}}) {
    if (!is_there) continue;
    const absl::StatusOr<double> found = coordinator::CpuSecondsOf(metadata, key);
    if (!found.ok()) return found.status();
    *seconds = *found;
  }
  return pilot;
}

// Reports why the job waits if the wait lasts.
absl::StatusOr<v1::Job> AwaitJob(FarmClient* client, const std::string& name, SteadyTime deadline) {
  ProgressLine line(kWaitSilence);
  while (true) {
    const absl::StatusOr<v1::Job> job = client->GetJob(name);
    if (!job.ok()) return job.status();
    if (job->state() == v1::Job::STATE_SUCCEEDED) return job;
    if (coordinator::IsSceneFailure(job->failure())) {
      return absl::InvalidArgumentError(job->failure());
    }
    if (HasEnded(*job)) {
      return absl::FailedPreconditionError(
          job->state() == v1::Job::STATE_CANCELLED
              ? "the quote's pilot was cancelled"
              : absl::StrCat("the quote's pilot failed: ", job->failure()));
    }
    if (!job->waiting_reason().empty()) line.Show("quote", 0, "waiting: " + job->waiting_reason());
    if (SteadyTime::Now() > deadline) {
      return absl::UnavailableError(job->waiting_reason().empty() ? "the pilot takes too long"
                                                                  : job->waiting_reason());
    }
    absl::SleepFor(kPollInterval);
  }
}

// Cancels the job if its result is no longer awaited.
absl::StatusOr<v1::Job> RunJob(FarmClient* client, const v1::CreateJobRequest& request,
                               SteadyTime deadline) {
  absl::StatusOr<v1::Job> job = client->CreateJob(request);
  absl::StatusOr<v1::Job> ended = job.ok() ? AwaitJob(client, job->name(), deadline) : job.status();
  if (ended.ok()) return ended;
  const std::unique_ptr<FarmClient> last = client->Uninterrupted();
  // The reply was lost to the interruption; repeating the request with its id returns the same job.
  if (absl::IsCancelled(job.status())) job = last->CreateJob(request);
  if (job.ok()) last->CancelJob(RequestFor<v1::CancelJobRequest>(job->name())).IgnoreError();
  return ended;
}

// The same view with each length multiplied by the place's scale.
FrameSettings Enlarged(FrameSettings settings, const ZoomedRegion& place) {
  const PixelRect& rect = place.rect;
  settings.width_px *= place.scale;
  settings.height_px *= place.scale;
  settings.window = {rect.x0 * place.scale, rect.y0 * place.scale, rect.x1 * place.scale,
                     rect.y1 * place.scale};
  return settings;
}

// Places where lights may be visible that are too small for the reduced image. Empty if the
// enlarged frame would exceed a farm's limits.
std::vector<ZoomedRegion> ZoomedRegionsOf(const PreparedFrame& frame,
                                          const std::vector<PilotLevel>& levels) {
  const FrameSettings& settings = frame.settings;
  const int32_t edge_px = std::max(settings.width_px, settings.height_px);
  if (edge_px > coordinator::Limits().frame_edge_px_max / coordinator::kZoomedPilotScaleMax)
    return {};
  double samples = 0, shrink = 0;
  for (const PilotLevel& level : levels) {
    if (level.is_light_image) continue;
    samples += level.SamplesPerPixel() * static_cast<double>(settings.window.PixelCount());
    shrink = std::max(shrink, static_cast<double>(level.shrink));
  }
  return coordinator::ChooseZoomedRegions(
      frame.emitters, settings.window, kZoomedPilotPixels * shrink, kZoomedPilotFraction * samples);
}

// The levels and zoomed pilots of one frame to render next.
struct PilotPlan {
  std::vector<PilotLevel> levels;
  std::vector<ZoomedRegion> zoomed_pilots;
};

// The job of pilot.frames.
absl::StatusOr<v1::Job> RunPilot(FarmClient* client, JobArguments arguments,
                                 const PreparedJob& pilot, SteadyTime deadline) {
  // Both images of a pair consist of the same number of parts, so that their costs tell the cost
  // per part apart from the cost of samples.
  arguments.pass_sample_count = coordinator::kPilotSamplesMax;
  arguments.stop = {};
  arguments.priority = kPilotPriority;
  arguments.title =
      absl::StrCat("quote of ", arguments.title.empty() ? arguments.scene : arguments.title);
  v1::CreateJobRequest request = MakeCreateJobRequest(arguments, pilot);
  request.set_pilot(true);
  return RunJob(client, request, deadline);
}

// Renders the plan of each frame, as one job.
absl::Status RenderPilot(FarmClient* client, const JobArguments& arguments, const PreparedJob& job,
                         const std::vector<PilotPlan>& plans, SteadyTime deadline,
                         std::vector<PilotFrame>* frames) {
  PreparedJob pilot;
  const auto add = [&](PreparedFrame frame, FrameSettings settings, const PilotLevel& level) {
    frame.number = static_cast<int>(pilot.frames.size()) + 1;
    frame.settings = std::move(settings);
    frame.resumed = {};
    frame.settings.samples = level.samples;
    frame.settings.lattice = level.lattice;
    // A separate training would cost more than the small image. A light image's training is as
    // small as the image, and light passes depend on the guiding of camera paths.
    if (level.lattice.All() && !level.is_light_image) {
      frame.settings.techniques = WithoutTraining(frame.settings.techniques);
      frame.settings.outputs = {};
      frame.settings.outputs.AddLightPaths();
    }
    pilot.frames.push_back(std::move(frame));
  };
  for (size_t i = 0; i < frames->size(); ++i) {
    const PreparedFrame& frame = job.frames[(*frames)[i].index];
    for (const PilotLevel& level : plans[i].levels) {
      add(frame, ShrunkFrame(frame.settings, level.shrink), level);
    }
    for (const ZoomedRegion& place : plans[i].zoomed_pilots) {
      FrameSettings settings = Enlarged(frame.settings, place);
      settings.techniques =
          TechniqueSet::kCamera;  // Only the emission that the camera sees counts.
      add(frame, std::move(settings), {{}, 1});
    }
  }
  const absl::StatusOr<v1::Job> ended = RunPilot(client, arguments, pilot, deadline);
  if (!ended.ok()) return ended.status();
  int next = 0;
  for (size_t i = 0; i < frames->size(); ++i) {
    PilotFrame& frame = (*frames)[i];
    const FrameSettings& settings = job.frames[frame.index].settings;
    const size_t tile_count = GridOf(arguments, settings).tiles().size();
    for (const PilotLevel& level : plans[i].levels) {
      const v1::Frame& rendered = ended->frames(next++);
      absl::StatusOr<PilotImage> image =
          FetchPilot(client, rendered, level, settings.techniques, tile_count);
      if (!image.ok()) return image.status();
      frame.images.push_back(*std::move(image));
      frame.cpu_seconds += Seconds(rendered.progress().cpu_duration());
    }
    for (const ZoomedRegion& place : plans[i].zoomed_pilots) {
      const v1::Frame& rendered = ended->frames(next++);
      absl::StatusOr<FrameImage> image = FetchImage(client, rendered);
      if (!image.ok()) return image.status();
      frame.zoomed_pilots.push_back({place, *std::move(image)});
      frame.cpu_seconds += Seconds(rendered.progress().cpu_duration());
    }
  }
  return absl::OkStatus();
}

void FitModels(const JobArguments& arguments, const PreparedJob& job,
               const std::optional<coordinator::ImageStart>& start,
               std::vector<PilotFrame>* frames) {
  for (PilotFrame& frame : *frames) {
    const PreparedFrame& prepared = job.frames[frame.index];
    frame.model = coordinator::FitErrorModel(GridOf(arguments, prepared.settings), frame.images,
                                             frame.zoomed_pilots, prepared.filter);
    if (start) coordinator::ContinueFrom(*start, &frame.model);
  }
}

coordinator::PilotTechniques NeedsOf(const FrameSettings& settings) {
  coordinator::PilotTechniques needs;
  if (HasLightPaths(settings.techniques)) {
    needs.light_paths_per_pixel = static_cast<double>(coordinator::PathsPerLightPass(settings)) /
                                  static_cast<double>(settings.window.PixelCount());
  }
  needs.is_guided = NeedsTraining(settings.techniques);
  return needs;
}

// The levels of a frame's next pilot: at first as many samples as the first round allows, later as
// many more as the forecast for the target allows. Empty if another pilot is not worth its cost.
std::vector<PilotLevel> NextLevels(const PilotFrame& frame, const FrameSettings& settings,
                                   double target) {
  const int64_t pixel_count = settings.window.PixelCount();
  std::vector<PilotLevel> before;
  double samples_before = 0;
  for (const PilotImage& image : frame.images) {
    before.push_back(image.level);
    if (!image.level.is_light_image) samples_before += image.level.SamplesPerPixel();
  }
  if (before.empty()) {
    return coordinator::PilotLevels(kPilotFractionAim * kReplicateCount, pixel_count, settings.seed,
                                    before, NeedsOf(settings));
  }
  const Forecast cheapest = coordinator::ForecastTarget(frame.model, {.target_error = target},
                                                        kStoppedSamplesMax, -kPriceDeviations);
  // A further pilot of a guided frame trains again.
  const double spent =
      (frame.cpu_seconds + frame.model.training_cpu_seconds) / cheapest.cpu_seconds;
  if (kPilotFractionAim < (1 + kPilotGrowthMin) * spent) return {};
  const double allowed =
      std::min((kPilotFractionAim - spent) * cheapest.samples, kPilotGrowthMax * samples_before);
  return coordinator::PilotLevels(allowed, pixel_count, settings.seed, before, NeedsOf(settings));
}

}  // namespace

coordinator::CellGrid GridOf(const JobArguments& arguments, const FrameSettings& settings) {
  const int32_t tile_size_px =
      arguments.tile_size_px != 0 ? arguments.tile_size_px : coordinator::Partition().tile_size_px;
  const int32_t cell_size_px = arguments.cell_size_px != 0
                                   ? arguments.cell_size_px
                                   : coordinator::ChooseCellSize(settings.window, tile_size_px);
  return {settings.window, tile_size_px, cell_size_px};
}

absl::StatusOr<std::vector<PilotOutput>> RenderAsPilot(FarmClient* client,
                                                       const JobArguments& arguments,
                                                       const PreparedJob& pilot,
                                                       SteadyTime deadline) {
  const absl::StatusOr<v1::Job> ended = RunPilot(client, arguments, pilot, deadline);
  if (!ended.ok()) return ended.status();
  std::vector<PilotOutput> outputs;
  for (const v1::Frame& frame : ended->frames()) {
    absl::StatusOr<FrameImage> image = FetchImage(client, frame);
    if (!image.ok()) return image.status();
    outputs.push_back({*std::move(image), Seconds(frame.progress().cpu_duration())});
  }
  return outputs;
}

absl::StatusOr<std::vector<FrameImage>> RenderDenoisedCrops(FarmClient* client,
                                                            const JobArguments& arguments,
                                                            const PreparedJob& job,
                                                            SteadyTime deadline,
                                                            double* cpu_seconds) {
  std::vector<FrameImage> images;
  const PreparedFrame& first = job.frames.front();
  if (!HasDenoised(first.settings.outputs)) return images;
  PreparedJob pilot;
  for (const PixelRect& crop : DenoisedCrops(first.settings.window)) {
    PreparedFrame& frame = pilot.frames.emplace_back(first);
    frame.number = static_cast<int>(pilot.frames.size());
    frame.resumed = {};
    frame.settings.window = crop;
    frame.settings.samples = kDenoisedPilotSamples;
    frame.settings.outputs = {};
    AddDenoised(&frame.settings.outputs);
    // A training would cost more than a crop.
    frame.settings.techniques = WithoutTraining(frame.settings.techniques);
  }
  if (pilot.frames.empty()) return images;
  absl::StatusOr<std::vector<PilotOutput>> rendered =
      RenderAsPilot(client, arguments, pilot, deadline);
  if (!rendered.ok()) return rendered.status();
  for (PilotOutput& output : *rendered) {
    images.push_back(std::move(output.image));
    *cpu_seconds += output.cpu_seconds;
  }
  return images;
}

absl::StatusOr<std::vector<PilotFrame>> RenderPilots(
    FarmClient* client, const JobArguments& arguments, const PreparedJob& job,
    const std::optional<coordinator::ImageStart>& start, double target, SteadyTime deadline) {
  std::vector<PilotFrame> frames = ChooseFrames(job.frames.size());
  const int count_max = start ? 1 : kPilotCountMax;
  for (int i = 0; i < count_max; ++i) {
    std::vector<PilotPlan> plans;
    bool more = false;
    for (const PilotFrame& frame : frames) {
      const PreparedFrame& prepared = job.frames[frame.index];
      PilotPlan plan{NextLevels(frame, prepared.settings, target), {}};
      if (frame.images.empty()) plan.zoomed_pilots = ZoomedRegionsOf(prepared, plan.levels);
      more |= !plan.levels.empty();
      plans.push_back(std::move(plan));
    }
    if (!more) break;
    absl::Status status = RenderPilot(client, arguments, job, plans, deadline, &frames);
    if (!status.ok()) return status;
    FitModels(arguments, job, start, &frames);
  }
  return frames;
}

}  // namespace sheaf::cli
