// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/ablation/technique_measurement.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "worker/render/ablation/technique_pilot.h"

namespace sheaf::render {
namespace {

// Paths of the first iteration of a training, over the samples of the image; in the first look,
// where guiding that is learned from less must look promising alone.
constexpr double kTrainingFraction = 1.0 / 8, kLookTrainingFraction = 1.0 / 16;
// Dark pixels count against this fraction of the image's mean, as in relMSE.
constexpr double kDarkFraction = 0.1;

double MeanOf(const PilotReplicates& replicates) {
  double sum = 0;
  for (const double value : replicates) sum += value;
  return sum / kReplicateCount;
}

// The variance of one sample, from the spread of the replicates of `samples`.
double SampleVarianceOf(const PilotReplicates& replicates, uint64_t samples) {
  const double mean = MeanOf(replicates);
  double squares = 0;
  for (const double value : replicates) squares += (value - mean) * (value - mean);
  return squares / (kReplicateCount - 1) * static_cast<double>(samples / kReplicateCount);
}

// The squares that squared errors are relative to, by pixel; empty for a black image. One image for
// all techniques, the mean of all pilots': an error relative to a pixel that has a rare bright
// sample looks small, so that a technique would seem the better the more of them it shares with the
// image.
std::vector<double> CommonSquares(const std::vector<Pilot>& pilots) {
  std::vector<double> squares(pilots.front().means.size());
  double total = 0;
  for (size_t pixel = 0; pixel < squares.size(); ++pixel) {
    double mean = 0;
    for (const Pilot& pilot : pilots) mean += MeanOf(pilot.means[pixel]);
    mean /= static_cast<double>(pilots.size());
    squares[pixel] = mean * mean;
    total += mean;
  }
  const double dark = kDarkFraction * total / static_cast<double>(squares.size());
  if (!(dark > 0)) return {};
  for (double& square : squares) square += dark * dark;
  return squares;
}

// The mean over the pixels of variance_of(pixel) over its square.
template <typename VarianceOf>
double RelativeMse(const std::vector<double>& squares, const VarianceOf& variance_of) {
  double sum = 0;
  for (size_t pixel = 0; pixel < squares.size(); ++pixel) {
    sum += variance_of(pixel) / squares[pixel];
  }
  return squares.empty() ? 0 : sum / static_cast<double>(squares.size());
}

// Compares images of one size: by camera paths, with light paths, with guiding, and maybe with
// both, in this order.
class Judge {
 public:
  // All outlive the judge.
  Judge(const std::vector<Pilot>& pilots, const FrameSettings& settings, const FrameSettings& frame)
      : pilots_(pilots), settings_(settings), frame_(frame), squares_(CommonSquares(pilots)) {}

  TechniqueMeasurement Measure() const {
    TechniqueMeasurement result;
    result.width_px = settings_.width_px;
    result.height_px = settings_.height_px;
    result.samples = settings_.samples;
    const Pilot& both = pilots_[1];
    result.camera = CostAlone(pilots_[0], both);
    result.both = Cost(both);
    result.guided = CostOfGuided(pilots_[2]);
    if (pilots_.size() > 3) result.guided_both = Cost(pilots_[3]);
    double light = 0;
    for (const PilotReplicates& replicates : both.means) {
      light += kReplicateCount * MeanOf(replicates);
    }
    if (light > 0) {
      result.light_share = both.light / light;
      result.only_light_share = both.only_light / light;
    }
    result.frame_samples = std::max<uint64_t>(frame_.samples, 1);
    result.missing_mse = std::max(
        0.0, RelativeMse(squares_, [&](size_t pixel) { return both.missing_squares[pixel]; }));
    return result;
  }
  // The cost of an image that has the light of all techniques.
  TechniqueCost Cost(const Pilot& pilot) const {
    return {RelativeMse(squares_, [&](size_t pixel) { return VarianceOf(pilot, pixel); }),
            pilot.cost_rays};
  }
  // The cost of guided camera paths alone.
  TechniqueCost CostOfGuided(const Pilot& pilot) const {
    return CostAlone(pilot, pilots_.size() > 3 ? pilots_[3] : pilots_[1]);
  }

 private:
  double VarianceOf(const Pilot& pilot, size_t pixel) const {
    return SampleVarianceOf(pilot.means[pixel], settings_.samples);
  }
  // `finder` has the light that `pilot` may miss.
  TechniqueCost CostAlone(const Pilot& pilot, const Pilot& finder) const {
    const auto variance_of = [&](size_t pixel) {
      const double mean = MeanOf(finder.means[pixel]);
      return std::max(VarianceOf(pilot, pixel), finder.moments[pixel] - mean * mean);
    };
    return {RelativeMse(squares_, variance_of), pilot.cost_rays};
  }

  const std::vector<Pilot>& pilots_;
  const FrameSettings& settings_;  // Those of the images.
  const FrameSettings& frame_;
  const std::vector<double> squares_;
};

bool IsPromising(const TechniqueMeasurement& look) {
  return look.Gain(TechniqueSet::kCameraAndLight) >= kPromisingGainMin ||
         look.Gain(TechniqueSet::kCameraGuided) >= kPromisingGainMin;
}

// The fraction of the frame's samples, rounded down to a power of two.
uint64_t SamplesFor(const FrameSettings& frame, uint64_t per_sample, uint64_t min, uint64_t max) {
  const double asked = FrameSamples(frame) / static_cast<double>(per_sample);
  return std::bit_floor(
      static_cast<uint64_t>(std::clamp(asked, static_cast<double>(min), static_cast<double>(max))));
}

// thorough: light paths and guiding together, too, and splitting where guiding pays.
absl::StatusOr<TechniqueMeasurement> MeasurePilots(const FrameSettings& frame, bool thorough,
                                                   PilotRenderer* renderer) {
  std::vector<Pilot> pilots;
  for (const TechniqueSet techniques :
       {TechniqueSet::kCamera, TechniqueSet::kCameraAndLight, TechniqueSet::kCameraGuided,
        TechniqueSet::kCameraAndLightGuided}) {
    if (techniques == TechniqueSet::kCameraAndLightGuided && !thorough) break;
    absl::StatusOr<Pilot> pilot = renderer->Render(techniques);
    if (!pilot.ok()) return pilot.status();
    pilots.push_back(*std::move(pilot));
  }
  const Judge judge(pilots, renderer->settings(), frame);
  TechniqueMeasurement result = judge.Measure();
  const TechniqueSet best = result.BestOfPlain();
  if (thorough && IsGuided(best)) {
    const absl::StatusOr<Pilot> split = renderer->Render(best.With(Technique::kSplitting));
    if (!split.ok()) return split.status();
    result.split = HasLightPaths(best) ? judge.Cost(*split) : judge.CostOfGuided(*split);
  }
  if (thorough && HasLightPaths(best)) {
    const absl::StatusOr<Pilot> guided = renderer->Render(best.With(Technique::kEmissionGuiding));
    if (!guided.ok()) return guided.status();
    result.emission_guided = judge.Cost(*guided);
  }
  return result;
}

}  // namespace

double TechniqueMeasurement::GainOfGuidedEmission() const {
  const TechniqueCost& without = IsGuided(BestOfPlain()) ? *guided_both : both;
  const double with = emission_guided->ErrorTimesCost();
  return with > 0 ? without.ErrorTimesCost() / with : 1;
}

double TechniqueMeasurement::Gain(TechniqueSet techniques) const {
  if (GuidesEmission(techniques)) {
    return Gain(techniques.Without(Technique::kEmissionGuiding)) * GainOfGuidedEmission();
  }
  const TechniqueCost& cost = SplitsPaths(techniques)                     ? *split
                              : techniques == TechniqueSet::kCamera       ? camera
                              : techniques == TechniqueSet::kCameraGuided ? guided
                              : IsGuided(techniques)                      ? *guided_both
                                                                          : both;
  const double error = ErrorTimesCost(cost, techniques);
  return error > 0 ? ErrorTimesCost(camera, TechniqueSet::kCamera) / error : 1;
}

double TechniqueMeasurement::ErrorTimesCost(const TechniqueCost& cost,
                                            TechniqueSet techniques) const {
  const double missing =
      HasLightPaths(techniques)
          ? 0
          : kMissingLightFactor * static_cast<double>(frame_samples) * missing_mse;
  return (cost.relative_mse + missing) * cost.cost_rays;
}

TechniqueSet TechniqueMeasurement::BestOfPlain() const {
  TechniqueSet best = TechniqueSet::kCamera;
  if (Gain(TechniqueSet::kCameraAndLight) >= kTechniqueGainMin)
    best = TechniqueSet::kCameraAndLight;
  if (Gain(TechniqueSet::kCameraGuided) >=
      std::max(kTechniqueGainMin, Gain(TechniqueSet::kCameraAndLight))) {
    best = TechniqueSet::kCameraGuided;
  }
  const double factor = best == TechniqueSet::kCamera ? kTechniqueGainMin : kCombinationGainMin;
  const bool combines = guided_both && guided_both->ErrorTimesCost() > 0 &&
                        Gain(TechniqueSet::kCameraAndLightGuided) >= factor * Gain(best);
  return combines ? TechniqueSet::kCameraAndLightGuided : best;
}

TechniqueSet TechniqueMeasurement::Best() const {
  const TechniqueSet plain = BestOfPlain();
  TechniqueSet best = plain;
  if (split && IsGuided(plain)) {
    const TechniqueCost& unsplit = HasLightPaths(plain) ? *guided_both : guided;
    const bool splits = split->ErrorTimesCost() > 0 &&
                        unsplit.ErrorTimesCost() >= kCombinationGainMin * split->ErrorTimesCost();
    if (splits) best = best.With(Technique::kSplitting);
  }
  if (emission_guided && HasLightPaths(plain) && GainOfGuidedEmission() >= kCombinationGainMin) {
    best = best.With(Technique::kEmissionGuiding);
  }
  return best;
}

absl::StatusOr<TechniqueMeasurement> MeasureTechniques(const SceneDescription& scene,
                                                       const FrameSettings& settings,
                                                       FileSource& files) {
  const auto measure = [&](uint64_t samples, double training_fraction,
                           bool thorough) -> absl::StatusOr<TechniqueMeasurement> {
    absl::StatusOr<PilotRenderer> renderer = PilotRenderer::Make(
        scene, settings, PilotSizeOf(settings, samples, training_fraction), files);
    if (!renderer.ok()) return renderer.status();
    return MeasurePilots(settings, thorough, &*renderer);
  };
  const uint64_t look_samples =
      SamplesFor(settings, kFrameSamplesPerLookSample, kPilotSamplesMin, kLookSamplesMax);
  const absl::StatusOr<TechniqueMeasurement> look =
      measure(look_samples, kLookTrainingFraction, false);
  if (!look.ok() || !IsPromising(*look)) return look;
  const uint64_t samples =
      SamplesFor(settings, kFrameSamplesPerPilotSample, kThoroughSamplesMin, kPilotSamplesMax);
  return measure(samples, kTrainingFraction, true);
}

std::string FormatTechniqueMeasurement(const TechniqueMeasurement& m) {
  const TechniqueSet best = m.Best();
  std::string text = absl::StrCat("techniques: ", best.Name(), "; ");
  if (m.only_light_share > 0) {
    absl::StrAppendFormat(&text, "light paths alone find %.2g %% of the light; ",
                          100 * m.only_light_share);
  }
  absl::StrAppendFormat(&text,
                        "times as efficient as camera paths: light paths %.2g, which find %.2g "
                        "%% of the light; guiding %.2g",
                        m.Gain(TechniqueSet::kCameraAndLight), 100 * m.light_share,
                        m.Gain(TechniqueSet::kCameraGuided));
  if (m.guided_both) {
    absl::StrAppendFormat(&text, "; both %.2g", m.Gain(TechniqueSet::kCameraAndLightGuided));
  }
  if (m.split) {
    const TechniqueSet split = m.BestOfPlain().With(Technique::kSplitting);
    absl::StrAppendFormat(&text, "; %s %.2g", split.Name(), m.Gain(split));
  }
  if (m.emission_guided) {
    absl::StrAppendFormat(&text, "; guided emission is %.2g times as efficient as unguided",
                          m.GainOfGuidedEmission());
  }
  absl::StrAppendFormat(&text, " (%d x %d pixels, %d samples, which cost as much as %.1f, %.1f",
                        m.width_px, m.height_px, m.samples, m.camera.cost_rays, m.both.cost_rays);
  if (m.guided_both) {
    absl::StrAppendFormat(&text, ", %.1f and %.1f rays of camera paths)", m.guided.cost_rays,
                          m.guided_both->cost_rays);
  } else {
    absl::StrAppendFormat(&text, " and %.1f rays of camera paths)", m.guided.cost_rays);
  }
  return text;
}

}  // namespace sheaf::render
