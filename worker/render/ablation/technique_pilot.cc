// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/ablation/technique_pilot.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "worker/render/guiding/training_size.h"
#include "worker/render/guiding_training.h"
#include "worker/render/light_tracer.h"
#include "worker/render/scene/compiled_scene.h"
#include "worker/render/tile_pass.h"

namespace sheaf::render {
namespace {

// The longer side of an image of kPilotSamplesMin samples, and its samples a pixel. One of four
// times the samples has twice the side, up to kPilotPxMax; one of twice the samples has twice as
// many in each pixel.
constexpr int32_t kPilotPx = 16, kPilotPxMax = 64;
constexpr uint64_t kPilotPixelSamples = kReplicateCount;

// Luminance of light paths by pixel, as the box filter of one pixel sees it.
class PilotSplats : public SplatSink {
 public:
  explicit PilotSplats(const FrameSettings& settings)
      : SplatSink(/*wants_moments=*/true),
        width_px_(settings.width_px),
        height_px_(settings.height_px),
        sums_(PixelCount()),
        moments_(PixelCount()),
        only_(PixelCount()) {}

  bool Covers(Vec2d raster) const override {
    return raster.x >= 0 && raster.x < width_px_ && raster.y >= 0 && raster.y < height_px_;
  }
  void Add(Vec2d raster, const Rgb& radiance, LightPathKind, uint32_t) override {
    if (!Covers(raster) || !IsFinite(radiance)) return;
    sums_[PixelOf(raster)][replicate_] += static_cast<double>(Luminance(radiance));
  }
  void AddMerged(int32_t x, int32_t y, const Rgb& radiance, const Rgb& /*bias*/, LightPathKind kind,
                 uint32_t group) override {
    Add({x + 0.5, y + 0.5}, radiance, kind, group);
  }
  void AddMoment(Vec2d raster, const Rgb& unweighted, double weight,
                 double camera_density) override {
    if (!Covers(raster) || !IsFinite(unweighted)) return;
    const auto value = static_cast<double>(Luminance(unweighted));
    if (camera_density > 0) {
      moments_[PixelOf(raster)] += weight * value * value / camera_density;
    } else {
      only_[PixelOf(raster)][replicate_ % 2] += value;
    }
  }

  void Trace(const CompiledScene& scene, uint64_t passes, RayCounts* counts) {
    LightTracer tracer(scene, {0, 0, width_px_, height_px_});
    for (uint64_t pass = 0; pass < passes; ++pass) {
      replicate_ = ReplicateOf(pass);
      tracer.TracePass(
          pass, [] { return true; }, this, counts);
    }
  }

  const PilotReplicates& SumsAt(size_t pixel) const { return sums_[pixel]; }
  // The sum over all passes of the second moment that a camera sample has by the light that light
  // paths find, as far as their weight goes.
  double MomentAt(size_t pixel) const { return moments_[pixel]; }
  // The sums of the light that camera paths cannot find, over the passes of even and of odd
  // replicates.
  const std::array<double, 2>& OnlyAt(size_t pixel) const { return only_[pixel]; }

 private:
  size_t PixelCount() const { return static_cast<size_t>(width_px_) * height_px_; }
  size_t PixelOf(Vec2d raster) const {
    return static_cast<size_t>(raster.y) * width_px_ + static_cast<size_t>(raster.x);
  }

  int32_t width_px_, height_px_;
  uint32_t replicate_ = 0;
  std::vector<PilotReplicates> sums_;
  std::vector<double> moments_;
  std::vector<std::array<double, 2>> only_;
};

// A small image of the whole frame.
FrameSettings PilotSettings(const FrameSettings& frame, const PilotSize& size) {
  FrameSettings pilot = frame;
  const double scale = std::min(
      1.0, static_cast<double>(size.longer_side_px) / std::max(frame.width_px, frame.height_px));
  pilot.width_px = std::max(1, static_cast<int32_t>(std::lround(frame.width_px * scale)));
  pilot.height_px = std::max(1, static_cast<int32_t>(std::lround(frame.height_px * scale)));
  pilot.window = {0, 0, pilot.width_px, pilot.height_px};
  pilot.samples = size.pixel_samples;
  pilot.outputs = {};
  pilot.lattice = {};
  pilot.one_sequence = false;
  pilot.techniques = TechniqueSet::kCamera;
  return pilot;
}

absl::Status RenderCameraPaths(const CompiledScene& scene, Pilot* pilot) {
  RenderStats stats;
  const FrameSettings& settings = scene.settings;
  const absl::StatusOr<FilmTile> film =
      RenderTilePass(scene, settings.window, {0, settings.samples}, {}, &stats);
  if (!film.ok()) return film.status();
  const double ray_cost = IsGuided(settings.techniques) ? kGuidedRayCost : 1;
  pilot->cost_rays +=
      ray_cost * static_cast<double>(stats.rays) / static_cast<double>(stats.samples);
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
  const auto passes = static_cast<double>(scene.settings.samples);
  splats.Trace(scene, scene.settings.samples, &counts);
  const double passes_of_replicate = passes / kReplicateCount;
  const size_t pixels = pilot->means.size();
  pilot->cost_rays +=
      kLightRayCost * static_cast<double>(counts.rays) / (static_cast<double>(pixels) * passes);
  pilot->moments.resize(pixels);
  pilot->missing_squares.resize(pixels);
  for (size_t pixel = 0; pixel < pixels; ++pixel) {
    pilot->moments[pixel] = splats.MomentAt(pixel) / passes;
    const auto [even, odd] = splats.OnlyAt(pixel);
    pilot->missing_squares[pixel] = even * odd / (passes * passes / 4);
    pilot->only_light += (even + odd) * kReplicateCount / passes;
    for (uint32_t r = 0; r < kReplicateCount; ++r) {
      const double splatted = splats.SumsAt(pixel)[r] / passes_of_replicate;
      pilot->means[pixel][r] += splatted;
      pilot->light += splatted;
    }
  }
}

}  // namespace

PilotSize PilotSizeOf(const FrameSettings& frame, uint64_t samples, double training_fraction) {
  const auto paths = static_cast<uint64_t>(static_cast<double>(samples) * training_fraction);
  PilotSize size{kPilotPx, kPilotPixelSamples,
                 std::min(paths, TrainingPathsFirst(frame.width_px, frame.height_px))};
  uint64_t factor = samples / kPilotSamplesMin;
  for (; factor >= 4 && size.longer_side_px < kPilotPxMax; factor /= 4) size.longer_side_px *= 2;
  size.pixel_samples *= factor;
  return size;
}

double FrameSamples(const FrameSettings& frame) {
  return static_cast<double>(frame.window.PixelCount()) *
         static_cast<double>(std::max<uint64_t>(frame.samples, 1));
}

absl::StatusOr<PilotRenderer> PilotRenderer::Make(SceneDescription scene,
                                                  const FrameSettings& frame, const PilotSize& size,
                                                  FileSource& files) {
  scene.filter = {};
  scene.filter.kind = FilterDescription::Kind::kBox;
  scene.filter.radius_x_px = scene.filter.radius_y_px = 0.5f;
  CompileTechniques techniques;
  techniques.training_paths_first = size.training_paths_first;
  absl::StatusOr<CompiledScenePtr> compiled =
      CompileScene(std::move(scene), PilotSettings(frame, size), files, {}, techniques);
  if (!compiled.ok()) return compiled.status();
  const double trainings_in_frames =
      static_cast<double>(TrainingPathsFirst(frame.width_px, frame.height_px)) /
      static_cast<double>(size.training_paths_first);
  return PilotRenderer(*std::move(compiled), FrameSamples(frame), trainings_in_frames);
}

absl::StatusOr<Pilot> PilotRenderer::Render(TechniqueSet techniques) {
  if (absl::Status set = SetTechniques(techniques, &scene_); !set.ok()) return set;
  Pilot pilot;
  if (NeedsTraining(techniques)) {
    if (absl::Status trained = Train(&pilot); !trained.ok()) return trained;
  }
  if (absl::Status rendered = RenderCameraPaths(*scene_, &pilot); !rendered.ok()) return rendered;
  if (HasLightPaths(techniques)) TraceLightPaths(*scene_, &pilot);
  return pilot;
}

// The rays of the frame's own training, which traces more paths, are spread over its samples.
absl::Status PilotRenderer::Train(Pilot* pilot) {
  RenderStats stats;
  const absl::StatusOr<std::string> fields = TrainGuiding(*scene_, 1, {}, &stats);
  if (!fields.ok()) return fields.status();
  pilot->cost_rays =
      kGuidedRayCost * static_cast<double>(stats.rays) * trainings_in_frames_ / frame_samples_;
  return SetGuiding(*scene_, *fields);
}

}  // namespace sheaf::render
