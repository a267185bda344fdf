// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/ablation/technique_pilot.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "common/scene/settings/chain_settings.h"
#include "worker/render/ablation/technique_choices.h"
#include "worker/render/guiding/training_size.h"
#include "worker/render/guiding_training.h"
#include "worker/render/light_tracer.h"
#include "worker/render/plan/chain_shapes.h"
#include "worker/render/plan/specular_surfaces.h"
#include "worker/render/scene/chain_seeds.h"
#include "worker/render/scene/compiled_scene.h"
#include "worker/render/tile_pass.h"

namespace sheaf::render {
namespace {

// The longer side of an image of kPilotSamplesMin samples, and its samples a pixel. One of four
// times the samples has twice the side, up to kPilotPxMax; one of twice the samples has twice as
// many in each pixel.
constexpr int32_t kPilotPx = 16, kPilotPxMax = 64;
constexpr uint64_t kPilotPixelSamples = kReplicateCount;

// About the rays of all light paths that leave seeds for chains.
constexpr double kChainSeedRays = 3.0 * kChainSeedsMax;

// Sums over the passes of even and of odd replicates.
using PilotHalves = std::array<double, 2>;

// Luminance of light paths by pixel, as the box filter of one pixel sees it.
class PilotSplats : public SplatSink {
 public:
  explicit PilotSplats(const FrameSettings& settings)
      : SplatSink(/*wants_moments=*/true),
        width_px_(settings.width_px),
        height_px_(settings.height_px),
        sums_(PixelCount()),
        moments_(PixelCount()),
        merged_moments_(PixelCount()),
        unchained_moments_(PixelCount()),
        unchained_merged_moments_(PixelCount()),
        only_(PixelCount()),
        only_merged_(PixelCount()),
        bias_(PixelCount()) {}

  bool Covers(Vec2d raster) const override {
    return raster.x >= 0 && raster.x < width_px_ && raster.y >= 0 && raster.y < height_px_;
  }
  void Add(Vec2d raster, const Rgb& radiance, LightPathKind, uint32_t) override {
    if (!Covers(raster) || !IsFinite(radiance)) return;
    sums_[PixelOf(raster)][replicate_] += static_cast<double>(Luminance(radiance));
  }
  // Follows AddMoment of the same splat.
  void AddMerged(int32_t x, int32_t y, const Rgb& radiance, const Rgb& bias, LightPathKind kind,
                 uint32_t group) override {
    const Vec2d raster{x + 0.5, y + 0.5};
    Add(raster, radiance, kind, group);
    if (!Covers(raster) || !IsFinite(radiance) || !IsFinite(bias)) return;
    bias_[PixelOf(raster)][replicate_ % 2] += static_cast<double>(Luminance(bias));
    merged_moments_[PixelOf(raster)] += last_moment_;
    if (!is_chain_) unchained_merged_moments_[PixelOf(raster)] += last_moment_;
    if (is_only_) {
      only_merged_[PixelOf(raster)][replicate_ % 2] += static_cast<double>(Luminance(radiance));
    }
  }
  void AddMoment(Vec2d raster, const Rgb& unweighted, double weight, double camera_density,
                 uint32_t interfaces) override {
    is_chain_ = interfaces > 0 && interfaces <= kChainInterfacesMax;
    is_only_ = !(camera_density > 0);
    last_moment_ = 0;
    if (!Covers(raster) || !IsFinite(unweighted)) return;
    const auto value = static_cast<double>(Luminance(unweighted));
    if (camera_density > 0) {
      last_moment_ = weight * value * value / camera_density;
      moments_[PixelOf(raster)] += last_moment_;
      if (!is_chain_) unchained_moments_[PixelOf(raster)] += last_moment_;
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
  // The same of the light that chains do not find.
  double UnchainedMomentAt(size_t pixel) const { return unchained_moments_[pixel]; }
  double UnchainedMergedMomentAt(size_t pixel) const { return unchained_merged_moments_[pixel]; }
  // The sums of the light that camera paths cannot find, over the passes of even and of odd
  // replicates.
  const PilotHalves& OnlyAt(size_t pixel) const { return only_[pixel]; }
  // The same of merges alone; and of the estimates of their bias.
  double MergedMomentAt(size_t pixel) const { return merged_moments_[pixel]; }
  const PilotHalves& OnlyMergedAt(size_t pixel) const { return only_merged_[pixel]; }
  const PilotHalves& BiasAt(size_t pixel) const { return bias_[pixel]; }

 private:
  size_t PixelCount() const { return static_cast<size_t>(width_px_) * height_px_; }
  size_t PixelOf(Vec2d raster) const {
    return static_cast<size_t>(raster.y) * width_px_ + static_cast<size_t>(raster.x);
  }

  int32_t width_px_, height_px_;
  uint32_t replicate_ = 0;
  std::vector<PilotReplicates> sums_;
  std::vector<double> moments_, merged_moments_, unchained_moments_, unchained_merged_moments_;
  bool is_only_ = false;   // Camera paths cannot find the last splat.
  bool is_chain_ = false;  // Chains find it.
  double last_moment_ = 0;
  std::vector<PilotHalves> only_, only_merged_, bias_;
};

// A small image of the whole frame.
FrameSettings PilotSettings(const FrameSettings& frame, const PilotSize& size) {
  FrameSettings pilot = frame;
  const double scale = std::min(
      1.0, static_cast<double>(size.longer_side_px) / std::max(frame.width_px, frame.height_px));
  const int32_t eyes = frame.IsStereo() ? 2 : 1;
  pilot.width_px =
      eyes * std::max(1, static_cast<int32_t>(std::lround(frame.width_px * scale / eyes)));
  pilot.height_px = std::max(1, static_cast<int32_t>(std::lround(frame.height_px * scale)));
  pilot.window = {0, 0, pilot.width_px, pilot.height_px};
  pilot.samples = size.pixel_samples;
  pilot.outputs = {};
  pilot.lattice = {};
  pilot.one_sequence = false;
  pilot.techniques = TechniqueSet::kCamera;
  return pilot;
}

double RayCostOf(TechniqueSet techniques) {
  if (SharesPaths(techniques)) return kSharingRayCost;
  const double of_product = ChoosesByProduct(techniques) ? kProductRayCost : 1;
  if (IsGuided(techniques)) return of_product * kGuidedRayCost;
  return of_product * (LearnsLights(techniques) ? kLearnedLightsRayCost : 1);
}

absl::Status RenderCameraTile(const CompiledScene& scene, PixelRect tile, Pilot* pilot,
                              RenderStats* stats) {
  const absl::StatusOr<FilmTile> film =
      RenderTilePass(scene, tile, {0, scene.settings.samples}, {}, stats);
  if (!film.ok()) return film.status();
  for (size_t pixel = 0; pixel < film->plane_size(); ++pixel) {
    PilotReplicates& means = pilot->means.emplace_back();
    for (uint32_t r = 0; r < kReplicateCount; ++r) {
      const Rgb sum{film->replicate(r, 0)[pixel], film->replicate(r, 1)[pixel],
                    film->replicate(r, 2)[pixel]};
      const auto weight = static_cast<double>(film->replicate(r, 3)[pixel]);
      means[r] = weight > 0 ? static_cast<double>(Luminance(sum)) / weight : 0;
    }
  }
  return absl::OkStatus();
}

absl::Status RenderCameraPaths(const CompiledScene& scene, Pilot* pilot) {
  RenderStats stats;
  if (absl::Status status = RenderCameraTile(scene, scene.settings.window, pilot, &stats);
      !status.ok()) {
    return status;
  }
  pilot->cost_rays += RayCostOf(scene.settings.techniques) * static_cast<double>(stats.rays) /
                      static_cast<double>(stats.samples);
  return absl::OkStatus();
}

// Statistics tell the moments of a pixel, so that each is a tile.
absl::Status RenderChains(const CompiledScene& scene, Pilot* pilot) {
  const PixelRect window = scene.settings.window;
  double rays = 0, samples = 0;
  for (int32_t y = window.y0; y < window.y1; ++y) {
    for (int32_t x = window.x0; x < window.x1; ++x) {
      RenderStats stats;
      if (absl::Status status = RenderCameraTile(scene, {x, y, x + 1, y + 1}, pilot, &stats);
          !status.ok()) {
        return status;
      }
      const auto of_pixel = static_cast<double>(stats.samples);
      rays += static_cast<double>(stats.rays);
      samples += of_pixel;
      pilot->chain_moments.push_back(stats.chain_moment / of_pixel);
      pilot->unconnected_chain_moments.push_back(stats.unconnected_chain_moment / of_pixel);
    }
  }
  pilot->cost_rays += kChainsRayCost * rays / samples;
  return absl::OkStatus();
}

// The squared bias of merging in the frame over that in the image, where both are small. A radius
// is in proportion to a pixel, and shrinks with the passes. Where light is smooth, squared bias
// falls as its fourth power; at edges of light, its mean falls as the radius. The square lies
// between.
double BiasScale(const FrameSettings& frame, const FrameSettings& image) {
  const double pixels = static_cast<double>(image.width_px) / frame.width_px;
  // The mean over n passes of a replicate of the square of MergeRadiusScale, which is n^(-1/6).
  const auto shrinking = [](const FrameSettings& settings) {
    const double passes = static_cast<double>(settings.samples) / kReplicateCount;
    return std::min(1.0, 1.5 * std::cbrt(1 / std::max(1.0, passes)));
  };
  return pixels * pixels * shrinking(frame) / shrinking(image);
}

// Adds what merges alone find, and their bias. Both squares are products of independent estimates.
void NoteMerges(const PilotSplats& splats, const FrameSettings& frame,
                const FrameSettings& settings, Pilot* pilot) {
  const auto passes = static_cast<double>(settings.samples);
  const double scale = BiasScale(frame, settings);
  for (size_t pixel = 0; pixel < pilot->means.size(); ++pixel) {
    pilot->merged_moments.push_back(splats.MergedMomentAt(pixel) / passes);
    pilot->unchained_merged_moments.push_back(splats.UnchainedMergedMomentAt(pixel) / passes);
    const auto square = [&](const PilotHalves& halves) {
      return halves[0] * halves[1] / (passes * passes / 4);
    };
    pilot->merged_missing_squares.push_back(square(splats.OnlyMergedAt(pixel)));
    pilot->bias_squares.push_back(scale * square(splats.BiasAt(pixel)));
  }
}

// Adds light paths to the image of the camera's.
void TraceLightPaths(const CompiledScene& scene, const FrameSettings& frame, Pilot* pilot) {
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
    pilot->unchained_moments.push_back(splats.UnchainedMomentAt(pixel) / passes);
    const auto [even, odd] = splats.OnlyAt(pixel);
    pilot->missing_squares[pixel] = even * odd / (passes * passes / 4);
    pilot->only_light += (even + odd) * kReplicateCount / passes;
    for (uint32_t r = 0; r < kReplicateCount; ++r) {
      const double splatted = splats.SumsAt(pixel)[r] / passes_of_replicate;
      pilot->means[pixel][r] += splatted;
      pilot->light += splatted;
    }
  }
  if (MergesLightPaths(scene.settings.techniques)) {
    NoteMerges(splats, frame, scene.settings, pilot);
  }
}

}  // namespace

PilotSize PilotSizeOf(const FrameSettings& frame, uint64_t samples, double training_fraction) {
  const uint64_t of_frame = TrainingPathsFirst(frame.width_px, frame.height_px);
  const auto paths = [&](double fraction) {
    return std::min(static_cast<uint64_t>(static_cast<double>(samples) * fraction), of_frame);
  };
  PilotSize size{kPilotPx,
                 kPilotPixelSamples,
                 {paths(training_fraction), paths(kEmissionTrainingFraction),
                  std::min(samples, of_frame << kLightsShift)}};
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
                                                  PilotFilter filter, FileSource& files) {
  if (filter == PilotFilter::kBox) {
    scene.filter = {};
    scene.filter.kind = FilterDescription::Kind::kBox;
    scene.filter.radius_x_px = scene.filter.radius_y_px = 0.5f;
  }
  const bool has_glossy_surfaces = MayHaveGlossySurfaces(scene);
  FrameSettings chained = frame;
  chained.techniques = kChainsChoice;
  const ChainShapes shapes = CheckChains(chained).ok() ? FindChainShapes(scene) : ChainShapes{};
  const bool may_have_chains = !shapes.casters.empty() && !shapes.lamps.empty();
  absl::StatusOr<ChangeableScenePtr> compiled =
      CompileChangeableScene(std::move(scene), PilotSettings(frame, size), files);
  if (!compiled.ok()) return compiled.status();
  return PilotRenderer(*std::move(compiled), frame, size.training, has_glossy_surfaces,
                       may_have_chains);
}

absl::StatusOr<Pilot> PilotRenderer::Render(TechniqueSet techniques) {
  if (absl::Status set = SetTechniques(techniques, scene_.get()); !set.ok()) return set;
  Pilot pilot;
  if (NeedsTraining(techniques)) {
    if (absl::Status trained = Train(&pilot); !trained.ok()) return trained;
  }
  const absl::Status rendered =
      HasChains(techniques) ? RenderChains(*scene_, &pilot) : RenderCameraPaths(*scene_, &pilot);
  if (!rendered.ok()) return rendered;
  // Their seeds are traced once in a frame.
  if (HasChains(techniques)) pilot.cost_rays += kChainSeedRays / FrameSamples(frame_);
  if (HasLightPaths(techniques)) TraceLightPaths(*scene_, frame_, &pilot);
  return pilot;
}

bool PilotRenderer::ChoosesLights() const {
  return scene_->lights->choice().visibility_slot_count() > 0;
}

bool PilotRenderer::MayChooseByProduct() const {
  return has_glossy_surfaces_ && scene_->lights->light_count() > kProductLightsMin;
}

bool PilotRenderer::MayHaveChains() const { return may_have_chains_; }

absl::StatusOr<bool> PilotRenderer::SeesThroughSpecular() {
  const TechniqueSet merging{Technique::kLightPaths, Technique::kMerging};
  if (absl::Status set = SetTechniques(merging, scene_.get()); !set.ok()) return set;
  RayCounts counts;
  LightTracer tracer(*scene_, settings().window);
  return tracer.CountGathered(0, &counts) > 0;
}

// The rays of the frame's own training, which traces more paths, are spread over its samples.
absl::Status PilotRenderer::Train(Pilot* pilot) {
  TrainingRays rays;
  const absl::StatusOr<std::string> fields = TrainGuidingOfSize(*scene_, training_, &rays);
  if (!fields.ok()) return fields.status();
  const auto of_frame = static_cast<double>(TrainingPathsFirst(frame_.width_px, frame_.height_px));
  const auto cost = [&](uint64_t count, uint64_t paths_first) {
    return static_cast<double>(count) * of_frame / static_cast<double>(paths_first);
  };
  // Where lights are learned alone, fewer paths learn them.
  const bool is_guided = IsGuided(settings().techniques);
  const uint64_t first = is_guided ? training_.first : training_.lights >> kLightsShift;
  pilot->cost_rays = (RayCostOf(settings().techniques) * cost(rays.camera, first) +
                      kLightRayCost * cost(rays.emission, training_.emission_first)) /
                     FrameSamples(frame_);
  return SetGuiding(*scene_, *fields);
}

}  // namespace sheaf::render
