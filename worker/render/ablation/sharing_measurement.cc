// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/ablation/sharing_measurement.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/film/film_tile.h"
#include "common/scene/settings/path_shares.h"
#include "worker/render/ablation/technique_choices.h"
#include "worker/render/ablation/technique_measurement.h"
#include "worker/render/ablation/technique_pilot.h"

namespace sheaf::render {
namespace {

// Dark pixels count against this fraction of the image's mean, as in relMSE.
constexpr double kSharedDarkFraction = 0.1;
// The edge of the blocks over which errors are summed: that of the largest usual filters, beyond
// which errors of pixels are independent.
constexpr size_t kBlockPx = 4;
constexpr double kSharedGainDeviations = 1.96;

double MeanOfPixel(const PilotReplicates& replicates) {
  double sum = 0;
  for (const double value : replicates) sum += value;
  return sum / kReplicateCount;
}

double VarianceOfPixel(const PilotReplicates& replicates) {
  const double mean = MeanOfPixel(replicates);
  double squares = 0;
  for (const double value : replicates) squares += (value - mean) * (value - mean);
  return squares / (kReplicateCount - 1);
}

// The variances of two images by block, relative to the squares of their common mean, times cost.
class Efficiencies {
 public:
  Efficiencies(const Pilot& without, const Pilot& with, size_t width)
      : without_(without), with_(with), width_(width) {
    double total = 0;
    for (size_t p = 0; p < without.means.size(); ++p) total += CommonMean(p);
    const double dark = kSharedDarkFraction * total / static_cast<double>(without.means.size());
    dark_square_ = dark * dark;
  }

  SharingGains Compare() const {
    if (!(dark_square_ > 0)) return {};
    const size_t columns = (width_ + kBlockPx - 1) / kBlockPx;
    const size_t rows = (without_.means.size() / width_ + kBlockPx - 1) / kBlockPx;
    std::vector<double> over(columns * rows), under(columns * rows);
    double over_sum = 0, under_sum = 0;
    for (size_t p = 0; p < without_.means.size(); ++p) {
      const double mean = CommonMean(p), square = mean * mean + dark_square_;
      const size_t block = p / width_ / kBlockPx * columns + p % width_ / kBlockPx;
      const double a = VarianceOfPixel(without_.means[p]) / square;
      const double b = VarianceOfPixel(with_.means[p]) / square;
      over[block] += a;
      under[block] += b;
      over_sum += a;
      under_sum += b;
    }
    if (!(over_sum > 0 && under_sum > 0)) return {};
    double squares = 0;
    for (size_t block = 0; block < over.size(); ++block) {
      const double speaks_for = over[block] / over_sum - under[block] / under_sum;
      squares += speaks_for * speaks_for;
    }
    const double gain = over_sum * without_.cost_rays / (under_sum * with_.cost_rays);
    return {gain, gain * std::exp(-kSharedGainDeviations * std::sqrt(squares))};
  }

 private:
  double CommonMean(size_t p) const {
    return (MeanOfPixel(without_.means[p]) + MeanOfPixel(with_.means[p])) / 2;
  }

  const Pilot& without_;
  const Pilot& with_;
  size_t width_;
  double dark_square_ = 0;
};

// A fraction of the frame's samples, as for the images of other techniques.
uint64_t SharedSamplesFor(const FrameSettings& frame) {
  const double asked = FrameSamples(frame) / static_cast<double>(kFrameSamplesPerPilotSample);
  return std::bit_floor(static_cast<uint64_t>(std::clamp(
      asked, static_cast<double>(kThoroughSamplesMin), static_cast<double>(kPilotSamplesMax))));
}

// Whether the camera has views to differ by.
bool HasViews(const CameraDescription& camera) {
  const bool moves =
      camera.world_from_camera.IsAnimated() && camera.shutter_close > camera.shutter_open;
  return camera.IsRealistic() || camera.lens_radius > 0 || moves;
}

}  // namespace

bool MayShare(const FrameSettings& settings) {
  FrameSettings shared = settings;
  shared.techniques = kSharedChoice;
  return !shared.one_sequence && WhyNoSharing(shared).empty();
}

TechniqueSet SharingMeasurement::Best() const {
  const auto pays = [](const SharingGains& gains) {
    return gains.gain >= kTechniqueGainMin && gains.least > 1;
  };
  if (views && pays(*views) &&
      views->gain >= kCombinationGainMin * (pays(sharing) ? sharing.gain : 1)) {
    return kSharedByViewsChoice;
  }
  return pays(sharing) ? kSharedChoice : TechniqueSet::kCamera;
}

double SharingMeasurement::Gain() const {
  const TechniqueSet best = Best();
  if (best == TechniqueSet::kCamera) return 1;
  return best == kSharedChoice ? sharing.gain : views->gain;
}

absl::StatusOr<SharingMeasurement> MeasureSharing(const SceneDescription& scene,
                                                  const FrameSettings& settings,
                                                  FileSource& files) {
  absl::StatusOr<PilotRenderer> renderer =
      PilotRenderer::Make(scene, settings, PilotSizeOf(settings, SharedSamplesFor(settings), 0),
                          PilotFilter::kScene, files);
  if (!renderer.ok()) return renderer.status();
  const absl::StatusOr<Pilot> without = renderer->Render(TechniqueSet::kCamera);
  if (!without.ok()) return without.status();
  const absl::StatusOr<Pilot> shared = renderer->Render(kSharedChoice);
  if (!shared.ok()) return shared.status();
  const FrameSettings& size = renderer->settings();
  SharingMeasurement result{size.width_px, size.height_px, size.samples, {}, {}};
  const auto width = static_cast<size_t>(size.width_px);
  result.sharing = Efficiencies(*without, *shared, width).Compare();
  if (HasViews(scene.camera)) {
    const absl::StatusOr<Pilot> by_views = renderer->Render(kSharedByViewsChoice);
    if (!by_views.ok()) return by_views.status();
    result.views = Efficiencies(*without, *by_views, width).Compare();
  }
  return result;
}

std::string FormatSharingMeasurement(const SharingMeasurement& m) {
  std::string text = absl::StrFormat(
      "sharing is %.2g times as efficient as paths of one pixel, at least %.2g with 95 %% "
      "confidence",
      m.sharing.gain, m.sharing.least);
  if (m.views)
    absl::StrAppendFormat(&text, "; with views %.2g, at least %.2g", m.views->gain, m.views->least);
  absl::StrAppendFormat(&text, " (%d x %d pixels, %d samples)", m.width_px, m.height_px, m.samples);
  if (m.Best() != TechniqueSet::kCamera) {
    text += "; noise of neighboring pixels is alike then: --techniques camera keeps it apart";
  }
  return text;
}

}  // namespace sheaf::render
