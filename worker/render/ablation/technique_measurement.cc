// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/ablation/technique_measurement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
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

struct Pilot {
  std::vector<Replicates> means;  // By pixel.
  double rays = 0;                // A pixel and sample.
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
                                              const FrameSettings& settings, FileSource& files) {
  SceneDescription boxed = scene;
  boxed.filter = {};
  boxed.filter.kind = FilterDescription::Kind::kBox;
  boxed.filter.radius_x_px = boxed.filter.radius_y_px = 0.5f;
  return CompileScene(std::move(boxed), settings, files);
}

absl::StatusOr<Pilot> RenderCameraPaths(const CompiledScene& scene) {
  RenderStats stats;
  const FrameSettings& settings = scene.settings;
  const absl::StatusOr<FilmTile> film =
      RenderTilePass(scene, settings.window, {0, settings.samples}, {}, &stats);
  if (!film.ok()) return film.status();
  Pilot pilot;
  pilot.rays = static_cast<double>(stats.rays) / static_cast<double>(stats.samples);
  pilot.means.resize(film->plane_size());
  for (size_t pixel = 0; pixel < pilot.means.size(); ++pixel) {
    for (uint32_t r = 0; r < kReplicateCount; ++r) {
      const Rgb sum{film->replicate(r, 0)[pixel], film->replicate(r, 1)[pixel],
                    film->replicate(r, 2)[pixel]};
      const auto weight = static_cast<double>(film->replicate(r, 3)[pixel]);
      pilot.means[pixel][r] = weight > 0 ? static_cast<double>(Luminance(sum)) / weight : 0;
    }
  }
  return pilot;
}

// The mean over the pixels of variance_of(pixel) over the squared mean of the combined image.
template <typename VarianceOf>
double RelativeMse(const std::vector<double>& image, const VarianceOf& variance_of) {
  double mean = 0;
  for (const double value : image) mean += value / static_cast<double>(image.size());
  const double dark = kDarkFraction * mean;
  if (!(dark > 0)) return 0;
  double sum = 0;
  for (size_t pixel = 0; pixel < image.size(); ++pixel) {
    sum += variance_of(pixel) / (image[pixel] * image[pixel] + dark * dark);
  }
  return sum / static_cast<double>(image.size());
}

}  // namespace

double TechniqueMeasurement::Gain() const {
  if (only_light_share > 0) return std::numeric_limits<double>::infinity();
  const double of_camera = camera.relative_mse * camera.rays,
               of_both = both.relative_mse * both.rays;
  return of_both > 0 ? of_camera / of_both : 1;
}

Techniques TechniqueMeasurement::Best() const {
  return Gain() >= kTechniqueGainMin ? Techniques::kCameraAndLight : Techniques::kCamera;
}

absl::StatusOr<TechniqueMeasurement> MeasureTechniques(const SceneDescription& scene,
                                                       const FrameSettings& settings,
                                                       FileSource& files) {
  const FrameSettings alone = PilotSettings(settings, Techniques::kCamera),
                      combined = PilotSettings(settings, Techniques::kCameraAndLight);
  const absl::StatusOr<CompiledScenePtr> camera_scene = CompilePilot(scene, alone, files);
  if (!camera_scene.ok()) return camera_scene.status();
  const absl::StatusOr<Pilot> camera = RenderCameraPaths(**camera_scene);
  if (!camera.ok()) return camera.status();
  const absl::StatusOr<CompiledScenePtr> both_scene = CompilePilot(scene, combined, files);
  if (!both_scene.ok()) return both_scene.status();
  absl::StatusOr<Pilot> both = RenderCameraPaths(**both_scene);
  if (!both.ok()) return both.status();
  PilotSplats splats(combined);
  RayCounts counts;
  splats.Trace(**both_scene, kTechniquePilotSamples, &counts);

  const size_t pixels = both->means.size();
  constexpr double kPassesOfReplicate = kTechniquePilotSamples / kReplicateCount;
  TechniqueMeasurement result;
  result.width_px = alone.width_px;
  result.height_px = alone.height_px;
  result.samples = kTechniquePilotSamples;
  std::vector<double> image(pixels);
  double light = 0, total = 0;
  for (size_t pixel = 0; pixel < pixels; ++pixel) {
    for (uint32_t r = 0; r < kReplicateCount; ++r) {
      const double splatted = splats.SumsAt(pixel)[r] / kPassesOfReplicate;
      both->means[pixel][r] += splatted;
      light += splatted;
      total += both->means[pixel][r];
    }
    image[pixel] = MeanOf(both->means[pixel]);
  }
  result.camera.rays = camera->rays;
  result.both.rays = both->rays + static_cast<double>(counts.rays) /
                                      static_cast<double>(pixels * kTechniquePilotSamples);
  result.both.relative_mse =
      RelativeMse(image, [&](size_t pixel) { return SampleVarianceOf(both->means[pixel]); });
  result.camera.relative_mse = RelativeMse(image, [&](size_t pixel) {
    const double missed =
        splats.MomentAt(pixel) / kTechniquePilotSamples - image[pixel] * image[pixel];
    return std::max(SampleVarianceOf(camera->means[pixel]), missed);
  });
  if (total > 0) {
    result.light_share = light / total;
    result.only_light_share =
        splats.only_light() * kReplicateCount / kTechniquePilotSamples / total;
  }
  return result;
}

std::string FormatTechniqueMeasurement(const TechniqueMeasurement& m) {
  const double gain = m.Gain();
  std::string text = absl::StrCat("techniques: ", TechniquesName(m.Best()), "; ");
  if (std::isinf(gain)) {
    absl::StrAppendFormat(&text, "light paths alone find %.2g %% of the light",
                          100 * m.only_light_share);
  } else {
    absl::StrAppendFormat(
        &text, "light paths find %.2g %% of the light and make the image %.2g times as efficient",
        100 * m.light_share, gain);
  }
  absl::StrAppendFormat(&text, " (%d x %d pixels, %d samples; %.1f rays a sample instead of %.1f)",
                        m.width_px, m.height_px, m.samples, m.both.rays, m.camera.rays);
  return text;
}

}  // namespace sheaf::render
