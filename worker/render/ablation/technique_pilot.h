// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Small images of a frame by several techniques, by which MeasureTechniques compares these.
#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/film/film_tile.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"
#include "worker/render/guiding_training.h"
#include "worker/render/scene/compile_scene.h"

namespace sheaf::render {

// The cost of a ray, in rays of unguided paths from the camera: for light paths, with their
// connections, splats and weights, and for guided paths, whose directions are mixtures. By CPU
// times, which gave 1.0 to 2.2 for light paths in five scenes and 1.4 to 1.5 for guided ones in
// two. For paths with learned lights, with their search for the region.
inline constexpr double kLightRayCost = 1.5, kGuidedRayCost = 1.3, kLearnedLightsRayCost = 1.1;
// The same for paths that choose lights by product, with the sketches of their vertices.
inline constexpr double kProductRayCost = 1.1;
// The same for chains, with their walks, in two scenes.
inline constexpr double kChainsRayCost = 1.8;
// The same for paths that count in several pixels: with equal rays, nine scenes took 1.1 to 1.5
// times the CPU time (docs/sharing.md).
inline constexpr double kSharingRayCost = 1.35;
// Products are measured in scenes with more lights than this and a glossy surface.
inline constexpr uint32_t kProductLightsMin = 32;
// Samples of the smallest and of the largest image.
inline constexpr uint64_t kPilotSamplesMin = uint64_t{1} << 12;
inline constexpr uint64_t kPilotSamplesMax = uint64_t{1} << 18;

struct PilotSize {
  int32_t longer_side_px = 0;
  uint64_t pixel_samples = 0;  // And passes of light paths.
  TrainingPaths training;
};
// Paths of the first iteration of a training of light paths, over the samples of the image: as in
// the smallest frames. A field of fewer paths would be a worse one than the frame has, and guided
// emission would seem to lose where it gains.
inline constexpr double kEmissionTrainingFraction = 1.0 / 2;
// samples: a power of two in [kPilotSamplesMin, kPilotSamplesMax]; of a square image, others have
// fewer. training_fraction: paths of the first iteration of a training of camera paths, over the
// samples. No training has more paths than the frame's own.
PilotSize PilotSizeOf(const FrameSettings& frame, uint64_t samples, double training_fraction);

// Samples of the frame's window.
double FrameSamples(const FrameSettings& frame);

// Mean luminance of the samples of a replicate.
using PilotReplicates = std::array<double, kReplicateCount>;

// kBox: one of a pixel, so that techniques have equal pixels. kScene: the scene's, through which
// pixels share paths.
enum class PilotFilter { kBox, kScene };

// By pixel.
struct Pilot {
  std::vector<PilotReplicates> means;
  double cost_rays = 0;  // A pixel and sample, with its part of the frame's training.
  // The second moment that a camera sample has by the light that light paths find, as far as their
  // weight goes; with light paths.
  std::vector<double> moments;
  // The square of the light that camera paths cannot find, as the product of two independent
  // estimates; with light paths.
  std::vector<double> missing_squares;
  // Moments and missing squares of the light that merges find: moments of all of it, squares of
  // what camera paths cannot find; and the squared bias of merging, in the frame. With merging.
  std::vector<double> merged_moments, merged_missing_squares, bias_squares;
  // The parts of `moments` and `merged_moments` that chains do not find; with light paths, with
  // merging.
  std::vector<double> unchained_moments, unchained_merged_moments;
  // The second moment that scattering would have by the light that chains find; and by the part of
  // it that light paths do not find. With chains.
  std::vector<double> chain_moments, unconnected_chain_moments;
  // Sums over the pixels, with light paths: of the light that they find, by their weights; and of
  // the light that camera paths cannot find.
  double light = 0, only_light = 0;
};

// Renders small images of one size. The scene is compiled once for all of them.
class PilotRenderer {
 public:
  // Errors: as CompileScene.
  static absl::StatusOr<PilotRenderer> Make(SceneDescription scene, const FrameSettings& frame,
                                            const PilotSize& size, PilotFilter filter,
                                            FileSource& files);
  const FrameSettings& settings() const { return SettingsOf(*scene_); }
  // Whether the scene has lights to choose among.
  bool ChoosesLights() const;
  // Whether it has more than kProductLightsMin, and glossy surfaces.
  bool MayChooseByProduct() const;
  // Whether chains may connect smooth surfaces of it with lamps, in a frame of such settings.
  bool MayHaveChains() const;
  // Errors: as SetTechniques and RenderTilePass.
  absl::StatusOr<Pilot> Render(TechniqueSet techniques);
  // Whether light paths can be merged with camera paths of the image: some see a rough surface
  // through smooth glass or in a mirror. Errors: as SetTechniques.
  absl::StatusOr<bool> SeesThroughSpecular();

 private:
  PilotRenderer(ChangeableScenePtr scene, const FrameSettings& frame, const TrainingPaths& training,
                bool has_glossy_surfaces, bool may_have_chains)
      : scene_(std::move(scene)),
        frame_(frame),
        training_(training),
        has_glossy_surfaces_(has_glossy_surfaces),
        may_have_chains_(may_have_chains) {}
  absl::Status Train(Pilot* pilot);

  ChangeableScenePtr scene_;
  FrameSettings frame_;
  TrainingPaths training_;
  bool has_glossy_surfaces_, may_have_chains_;
};

}  // namespace sheaf::render
