// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/ablation/technique_measurement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "worker/render/guiding/training_size.h"
#include "worker/render/guiding_training.h"
#include "worker/render/integrator/variants.h"
#include "worker/render/scene/compiled_scene.h"
#include "worker/render/tile_pass.h"

namespace sheaf::render {
namespace {

// Dark pixels count against this fraction of the image's mean, as in relMSE.
constexpr double kDarkFraction = 0.1;

using Replicates = std::array<double, kReplicateCount>;

// Luminance of light paths by pixel, as the box filter of one pixel sees it.
class PilotSplats : public SplatSink {
 public:
  explicit PilotSplats(const FrameSettings& settings)
      : SplatSink(/*wants_moments=*/true),
        width_px_(settings.width_px),
        height_px_(settings.height_px),
        sums_(PixelCount()),
        moments_(PixelCount()) {}

  bool Covers(Vec2d raster) const override {
    return raster.x >= 0 && raster.x < width_px_ && raster.y >= 0 && raster.y < height_px_;
  }
  void Add(Vec2d raster, const Rgb& radiance, LightPathKind, uint32_t) override {
    if (!Covers(raster) || !IsFinite(radiance)) return;
    sums_[PixelOf(raster)][replicate_] += static_cast<double>(Luminance(radiance));
  }
  void AddMoment(Vec2d raster, const Rgb& unweighted, double weight,
                 double camera_density) override {
    if (!Covers(raster) || !IsFinite(unweighted)) return;
    const auto value = static_cast<double>(Luminance(unweighted));
    if (camera_density > 0) {
      moments_[PixelOf(raster)] += weight * value * value / camera_density;
    } else {
      only_light_ += value;
    }
  }

  void Trace(const CompiledScene& scene, uint64_t passes, RayCounts* counts) {
    const LightRowFunction trace_row = LightRowFunctionOf(
        ChooseLightPathVariant(scene.plan.traits, scene.settings.force_generic_variant));
    for (uint64_t pass = 0; pass < passes; ++pass) {
      replicate_ = ReplicateOf(pass);
      for (int32_t y = 0; y < height_px_; ++y) {
        trace_row(scene, 0, width_px_, y, pass, this, counts);
      }
    }
  }

  const Replicates& SumsAt(size_t pixel) const { return sums_[pixel]; }
  // The sum over all passes of the second moment that a camera sample has by the light that light
  // paths find, as far as their weight goes.
  double MomentAt(size_t pixel) const { return moments_[pixel]; }
  double only_light() const { return only_light_; }

 private:
  size_t PixelCount() const { return static_cast<size_t>(width_px_) * height_px_; }
  size_t PixelOf(Vec2d raster) const {
    return static_cast<size_t>(raster.y) * width_px_ + static_cast<size_t>(raster.x);
  }

  int32_t width_px_, height_px_;
  uint32_t replicate_ = 0;
  std::vector<Replicates> sums_;
  std::vector<double> moments_;
  double only_light_ = 0;
};

// A small image of the whole frame.
FrameSettings PilotSettings(const FrameSettings& frame, Techniques techniques) {
  FrameSettings pilot = frame;
  const double scale = std::min(
      1.0, static_cast<double>(kTechniquePilotPx) / std::max(frame.width_px, frame.height_px));
  pilot.width_px = std::max(1, static_cast<int32_t>(std::lround(frame.width_px * scale)));
  pilot.height_px = std::max(1, static_cast<int32_t>(std::lround(frame.height_px * scale)));
  pilot.window = {0, 0, pilot.width_px, pilot.height_px};
  pilot.samples = kTechniquePilotSamples;
  pilot.outputs = {};
  pilot.lattice = {};
  pilot.one_sequence = false;
  pilot.techniques = techniques;
  return pilot;
}

// By pixel.
struct Pilot {
  std::vector<Replicates> means;
  double rays = 0;              // A pixel and sample.
  std::vector<double> moments;  // Of a camera sample, as PilotSplats::MomentAt; with light paths.
  double light = 0, only_light = 0;  // Sums over the pixels; with light paths.
};

double MeanOf(const Replicates& replicates) {
  double sum = 0;
  for (const double value : replicates) sum += value;
  return sum / kReplicateCount;
}

// The variance of one sample, from the spread of the replicates.
double SampleVarianceOf(const Replicates& replicates) {
  const double mean = MeanOf(replicates);
  double squares = 0;
  for (const double value : replicates) squares += (value - mean) * (value - mean);
  return squares / (kReplicateCount - 1) * (kTechniquePilotSamples / kReplicateCount);
}

absl::StatusOr<CompiledScenePtr> CompilePilot(const SceneDescription& scene,
                                              const FrameSettings& settings,
                                              uint64_t training_paths_first, FileSource& files) {
  SceneDescription boxed = scene;
  boxed.filter = {};
  boxed.filter.kind = FilterDescription::Kind::kBox;
  boxed.filter.radius_x_px = boxed.filter.radius_y_px = 0.5f;
  CompileTechniques techniques;
  techniques.training_paths_first = training_paths_first;
  return CompileScene(std::move(boxed), settings, files, {}, techniques);
}

absl::Status RenderCameraPaths(const CompiledScene& scene, Pilot* pilot) {
  RenderStats stats;
  const FrameSettings& settings = scene.settings;
  const absl::StatusOr<FilmTile> film =
      RenderTilePass(scene, settings.window, {0, settings.samples}, {}, &stats);
  if (!film.ok()) return film.status();
  pilot->rays += static_cast<double>(stats.rays) / static_cast<double>(stats.samples);
  pilot->means.resize(film->plane_size());
  for (size_t pixel = 0; pixel < pilot->means.size(); ++pixel) {
    for (uint32_t r = 0; r < kReplicateCount; ++r) {
      const Rgb sum{film->replicate(r, 0)[pixel], film->replicate(r, 1)[pixel],
                    film->replicate(r, 2)[pixel]};
      const auto weight = static_cast<double>(film->replicate(r, 3)[pixel]);
      pilot->means[pixel][r] = weight > 0 ? static_cast<double>(Luminance(sum)) / weight : 0;
    }
  }
  return absl::OkStatus();
}

// Adds light paths to the image of the camera's.
void TraceLightPaths(const CompiledScene& scene, Pilot* pilot) {
  PilotSplats splats(scene.settings);
  RayCounts counts;
  splats.Trace(scene, kTechniquePilotSamples, &counts);
  constexpr double kPassesOfReplicate = kTechniquePilotSamples / kReplicateCount;
  const size_t pixels = pilot->means.size();
  pilot->rays +=
      static_cast<double>(counts.rays) / static_cast<double>(pixels * kTechniquePilotSamples);
  pilot->moments.resize(pixels);
  for (size_t pixel = 0; pixel < pixels; ++pixel) {
    pilot->moments[pixel] = splats.MomentAt(pixel) / kTechniquePilotSamples;
    for (uint32_t r = 0; r < kReplicateCount; ++r) {
      const double splatted = splats.SumsAt(pixel)[r] / kPassesOfReplicate;
      pilot->means[pixel][r] += splatted;
      pilot->light += splatted;
    }
  }
  pilot->only_light = splats.only_light() * kReplicateCount / kTechniquePilotSamples;
}

absl::StatusOr<Pilot> RenderPilot(const SceneDescription& scene, const FrameSettings& frame,
                                  Techniques techniques, FileSource& files) {
  const absl::StatusOr<CompiledScenePtr> compiled = CompilePilot(
      scene, PilotSettings(frame, techniques),
      std::min(kPilotTrainingPathsFirst, TrainingPathsFirst(frame.width_px, frame.height_px)),
      files);
  if (!compiled.ok()) return compiled.status();
  Pilot pilot;
  if (IsGuided(techniques)) {
    RenderStats stats;
    const absl::StatusOr<std::string> fields = TrainGuiding(**compiled, 1, {}, &stats);
    if (!fields.ok()) return fields.status();
    if (absl::Status set = SetGuiding(**compiled, *fields); !set.ok()) return set;
    const double samples = static_cast<double>(frame.width_px) *
                           static_cast<double>(frame.height_px) *
                           static_cast<double>(std::max<uint64_t>(frame.samples, 1));
    pilot.rays = static_cast<double>(stats.rays) / samples;
  }
  if (absl::Status rendered = RenderCameraPaths(**compiled, &pilot); !rendered.ok()) {
    return rendered;
  }
  if (HasLightPaths(techniques)) TraceLightPaths(**compiled, &pilot);
  return pilot;
}

// The squares that squared errors are relative to, by pixel; empty for a black image. One image for
// all techniques, the mean of all pilots': an error relative to a pixel that has a rare bright
// sample looks small, so that a technique would seem the better the more of them it shares with the
// image.
std::vector<double> CommonSquares(std::initializer_list<const Pilot*> pilots) {
  std::vector<double> squares((*pilots.begin())->means.size());
  double total = 0;
  for (size_t pixel = 0; pixel < squares.size(); ++pixel) {
    double mean = 0;
    for (const Pilot* pilot : pilots) mean += MeanOf(pilot->means[pixel]);
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

}  // namespace

double TechniqueMeasurement::Gain(Techniques techniques) const {
  const TechniqueCost& cost = SplitsPaths(techniques)                   ? *split
                              : techniques == Techniques::kCamera       ? camera
                              : techniques == Techniques::kCameraGuided ? guided
                              : IsGuided(techniques)                    ? guided_both
                                                                        : both;
  if (only_light_share > 0) {
    return HasLightPaths(techniques) ? std::numeric_limits<double>::infinity() : 0;
  }
  return cost.ErrorTimesCost() > 0 ? camera.ErrorTimesCost() / cost.ErrorTimesCost() : 1;
}

Techniques TechniqueMeasurement::Best() const {
  Techniques best = Techniques::kCamera;
  if (Gain(Techniques::kCameraAndLight) >= kTechniqueGainMin) best = Techniques::kCameraAndLight;
  if (Gain(Techniques::kCameraGuided) >=
      std::max(kTechniqueGainMin, Gain(Techniques::kCameraAndLight))) {
    best = Techniques::kCameraGuided;
  }
  const TechniqueCost& simpler = best == Techniques::kCameraGuided     ? guided
                                 : best == Techniques::kCameraAndLight ? both
                                                                       : camera;
  const double factor = best == Techniques::kCamera ? kTechniqueGainMin : kCombinationGainMin;
  const bool combines = guided_both.ErrorTimesCost() > 0 &&
                        simpler.ErrorTimesCost() >= factor * guided_both.ErrorTimesCost();
  if (combines) best = Techniques::kCameraAndLightGuided;
  if (!split || !IsGuided(best)) return best;
  const TechniqueCost& unsplit = HasLightPaths(best) ? guided_both : guided;
  const bool splits = split->ErrorTimesCost() > 0 &&
                      unsplit.ErrorTimesCost() >= kCombinationGainMin * split->ErrorTimesCost();
  return splits ? WithSplitting(best) : best;
}

absl::StatusOr<TechniqueMeasurement> MeasureTechniques(const SceneDescription& scene,
                                                       const FrameSettings& settings,
                                                       FileSource& files) {
  const absl::StatusOr<Pilot> camera = RenderPilot(scene, settings, Techniques::kCamera, files);
  if (!camera.ok()) return camera.status();
  const absl::StatusOr<Pilot> both =
      RenderPilot(scene, settings, Techniques::kCameraAndLight, files);
  if (!both.ok()) return both.status();
  const absl::StatusOr<Pilot> guided =
      RenderPilot(scene, settings, Techniques::kCameraGuided, files);
  if (!guided.ok()) return guided.status();
  const absl::StatusOr<Pilot> guided_both =
      RenderPilot(scene, settings, Techniques::kCameraAndLightGuided, files);
  if (!guided_both.ok()) return guided_both.status();

  const FrameSettings small = PilotSettings(settings, Techniques::kCamera);
  TechniqueMeasurement result;
  result.width_px = small.width_px;
  result.height_px = small.height_px;
  result.samples = kTechniquePilotSamples;
  const std::vector<double> squares = CommonSquares({&*camera, &*both, &*guided, &*guided_both});
  double total = 0;
  for (const Replicates& replicates : both->means) total += kReplicateCount * MeanOf(replicates);
  const auto complete = [&](const Pilot& pilot) -> TechniqueCost {
    return {
        RelativeMse(squares, [&](size_t pixel) { return SampleVarianceOf(pilot.means[pixel]); }),
        pilot.rays};
  };
  // `finder` has the light that `pilot` may miss.
  const auto alone = [&](const Pilot& pilot, const Pilot& finder) -> TechniqueCost {
    const auto variance_of = [&](size_t pixel) {
      const double mean = MeanOf(finder.means[pixel]);
      const double missed = finder.moments[pixel] - mean * mean;
      return std::max(SampleVarianceOf(pilot.means[pixel]), missed);
    };
    return {RelativeMse(squares, variance_of), pilot.rays};
  };
  result.camera = alone(*camera, *both);
  result.both = complete(*both);
  result.guided = alone(*guided, *guided_both);
  result.guided_both = complete(*guided_both);
  if (total > 0) {
    result.light_share = both->light / total;
    result.only_light_share = both->only_light / total;
  }
  if (const Techniques best = result.Best(); IsGuided(best)) {
    const absl::StatusOr<Pilot> split = RenderPilot(scene, settings, WithSplitting(best), files);
    if (!split.ok()) return split.status();
    result.split = HasLightPaths(best) ? complete(*split) : alone(*split, *guided_both);
  }
  return result;
}

std::string FormatTechniqueMeasurement(const TechniqueMeasurement& m) {
  const Techniques best = m.Best();
  std::string text = absl::StrCat("techniques: ", TechniquesName(best), "; ");
  if (m.only_light_share > 0) {
    absl::StrAppendFormat(&text, "light paths alone find %.2g %% of the light",
                          100 * m.only_light_share);
  } else {
    absl::StrAppendFormat(&text,
                          "times as efficient as camera paths: light paths %.2g, which find %.2g "
                          "%% of the light; guiding %.2g; both %.2g",
                          m.Gain(Techniques::kCameraAndLight), 100 * m.light_share,
                          m.Gain(Techniques::kCameraGuided),
                          m.Gain(Techniques::kCameraAndLightGuided));
    if (m.split) {
      absl::StrAppendFormat(&text, "; %s %.2g", TechniquesName(WithSplitting(best)),
                            m.Gain(WithSplitting(best)));
    }
  }
  absl::StrAppendFormat(
      &text, " (%d x %d pixels, %d samples; %.1f, %.1f, %.1f and %.1f rays a sample)", m.width_px,
      m.height_px, m.samples, m.camera.rays, m.both.rays, m.guided.rays, m.guided_both.rays);
  return text;
}

}  // namespace sheaf::render
