// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/quote/sharing_pilot.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "cli/quote/shrunk_frame.h"
#include "common/film/error/error_estimate.h"
#include "common/film/error/eye_errors.h"
#include "common/film/film_tile.h"
#include "common/film/frame_image.h"
#include "coordinator/forecast/pilot_model.h"

namespace sheaf::cli {
namespace {

// Samples of the small images over those of the frame's first round, and the range of the pixels of
// one of them.
constexpr double kSmallFraction = 0.01;
constexpr double kSmallPixelsMin = 512, kSmallPixelsMax = 8192;
// Several samples in each replicate, so that the cost of parts does not count.
constexpr uint64_t kSmallSamples = coordinator::kPilotSamplesMax;

// The small image without sharing.
FrameSettings SmallPlain(const FrameSettings& settings) {
  const FrameSettings plain = WithoutSharing(settings);
  const auto pixels = static_cast<double>(plain.window.PixelCount());
  const double wanted =
      std::clamp(kSmallFraction * pixels * kReplicateCount / (2.0 * kSmallSamples), kSmallPixelsMin,
                 kSmallPixelsMax);
  const auto shrink = static_cast<int32_t>(std::ceil(std::sqrt(pixels / wanted)));
  FrameSettings small = ShrunkFrame(plain, std::max(1, shrink));
  small.samples = kSmallSamples;
  return small;
}

// The same with the frame's sharing.
FrameSettings SmallShared(const FrameSettings& settings) {
  FrameSettings small = SmallPlain(settings);
  small.techniques = settings.techniques;
  small.eye_distance = settings.eye_distance;
  small.eye_convergence = settings.eye_convergence;
  if (settings.IsStereo()) {
    small.width_px *= 2;
    small.window.x1 = small.width_px;
  }
  return small;
}

ErrorSums ErrorOf(const FrameImage& image) {
  if (HasEyeDifference(image)) return EstimateEyeErrors(image).OfWorse();
  return EstimateTileErrors(image, {&image.window, 1}).front();
}

}  // namespace

FrameSettings WithoutSharing(FrameSettings settings) {
  if (settings.IsStereo()) {
    settings.width_px /= 2;
    settings.window.x1 = settings.width_px;
  }
  settings.eye_distance = settings.eye_convergence = 0;
  settings.techniques = settings.techniques.Without(Technique::kSharing);
  return settings;
}

PreparedJob WithoutSharing(PreparedJob job) {
  for (PreparedFrame& frame : job.frames) frame.settings = WithoutSharing(frame.settings);
  return job;
}

SharingGain GainOf(const PilotOutput& shared, const PilotOutput& plain) {
  SharingGain gain;
  const ErrorSums with = ErrorOf(shared.image), without = ErrorOf(plain.image);
  if (with.sum > 0 && without.sum > 0) {
    gain.error_ratio = with.RelativeMse() / without.RelativeMse();
    gain.log_error_deviation = std::hypot(with.Deviation() / with.RelativeMse(),
                                          without.Deviation() / without.RelativeMse());
  }
  if (shared.cpu_seconds > 0 && plain.cpu_seconds > 0) {
    gain.cpu_ratio = shared.cpu_seconds / plain.cpu_seconds;
  }
  return gain;
}

void ApplySharing(const SharingGain& gain, coordinator::ErrorModel* model) {
  coordinator::ForecastCell whole;
  whole.measured.samples = model->cells.front().measured.samples;
  for (const coordinator::ForecastCell& cell : model->cells) {
    whole.measured.error.Add(cell.measured.error);
    whole.cpu_seconds_per_sample += cell.cpu_seconds_per_sample;
  }
  whole.measured.error.sum *= gain.error_ratio;
  whole.measured.error.square_sum *= gain.error_ratio * gain.error_ratio;
  whole.cpu_seconds_per_sample *= gain.cpu_ratio;
  model->cells = {whole};
  model->silhouettes.JoinCells();
  model->log_error_deviation = std::hypot(model->log_error_deviation, gain.log_error_deviation);
}

absl::StatusOr<SharingGain> MeasureSharing(FarmClient* client, const JobArguments& arguments,
                                           const PreparedJob& job, SteadyTime deadline,
                                           std::vector<PilotFrame>* frames) {
  PreparedJob pilot;
  for (const PilotFrame& frame : *frames) {
    const PreparedFrame& prepared = job.frames[frame.index];
    for (const FrameSettings& settings :
         {SmallShared(prepared.settings), SmallPlain(prepared.settings)}) {
      PreparedFrame& added = pilot.frames.emplace_back(prepared);
      added.number = static_cast<int32_t>(pilot.frames.size());
      added.settings = settings;
    }
  }
  const absl::StatusOr<std::vector<PilotOutput>> outputs =
      RenderAsPilot(client, arguments, pilot, deadline);
  if (!outputs.ok()) return outputs.status();
  SharingGain first;
  for (size_t i = 0; i < frames->size(); ++i) {
    const PilotOutput& shared = (*outputs)[2 * i];
    const PilotOutput& plain = (*outputs)[2 * i + 1];
    const SharingGain gain = GainOf(shared, plain);
    ApplySharing(gain, &(*frames)[i].model);
    (*frames)[i].cpu_seconds += shared.cpu_seconds + plain.cpu_seconds;
    if (i == 0) first = gain;
  }
  return first;
}

}  // namespace sheaf::cli
