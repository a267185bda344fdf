// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests that paths which a learned field guides, or whose light samples go by one, find the same
// light as other paths, whatever the field has learned, and that they find it with less noise where
// light is hard to find.
#include <gtest/gtest.h>

#include <cstdio>
#include <iterator>
#include <string>
#include <variant>
#include <vector>

#include "tests/support/frame_estimates.h"
#include "tests/support/guided_scenes.h"
#include "worker/render/guiding_training.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {
namespace {

using sheaf::testing::Bias;
using sheaf::testing::BiasOfNoisyPair;
using sheaf::testing::ExpectAgreement;
using sheaf::testing::kSizePx;
using sheaf::testing::Samples;
using sheaf::testing::TilePair;
using testing::Estimate;

constexpr Tint kColored{1};
constexpr TechniqueSet kGuided = TechniqueSet::kCameraGuided,
                       kBothGuided = TechniqueSet::kCameraAndLightGuided,
                       kLearnedLights{Technique::kLearnedLights};

struct Rendering {
  TechniqueSet techniques = TechniqueSet::kCamera;
  ColorTransport color = ColorTransport::kRgb;
  uint64_t seed = 0, samples = 64;
  int32_t depth = 4;
  uint64_t training_paths_first = 4096;
};

CompiledScenePtr CompileFor(const TestScene& scene, const Rendering& rendering) {
  FrameSettings settings = SquareSettings(kSizePx, rendering.samples, rendering.depth);
  settings.seed = rendering.seed;
  settings.color = rendering.color;
  settings.techniques = rendering.techniques;
  return Compile(scene.scene, settings, {.training_paths_first = rendering.training_paths_first});
}

// Fails the test where a guided frame has learned nothing.
std::vector<Estimate> Render(const TestScene& scene, const Rendering& rendering) {
  const CompiledScenePtr compiled = CompileFor(scene, rendering);
  std::vector<Estimate> estimates = EstimatesOfBoth(RenderBothFilms(*compiled));
  EXPECT_EQ(compiled->guiding != nullptr, NeedsTraining(rendering.techniques));
  if (compiled->guiding != nullptr) {
    EXPECT_GT(compiled->guiding->fields()->directions.region_count(), 3u);
  }
  return estimates;
}

std::vector<TilePair> TilePairs(const std::vector<TestScene>& scenes, Rendering a, Rendering b) {
  std::vector<TilePair> tiles;
  for (const TestScene& scene : scenes) {
    const std::vector<Estimate> of_a = Render(scene, a), of_b = Render(scene, b);
    for (size_t tile = 0; tile < of_a.size(); ++tile) tiles.push_back({of_a[tile], of_b[tile]});
    a.seed += 2;
    b.seed += 2;
  }
  return tiles;
}

// The guided frames of the scenes have the mean of camera paths alone.
void ExpectGuidedAgree(const std::string& name, const std::vector<TestScene>& scenes, double bias,
                       Rendering guided, uint64_t seed = 100) {
  guided.seed = seed + 1;
  guided.samples = Samples(guided.samples);
  Rendering camera = guided;
  camera.techniques = TechniqueSet::kCamera;
  camera.seed = seed;
  ExpectAgreement(name, bias, TilePairs(scenes, camera, guided));
}

// Every kind of light, and lens, motion, cut-outs, media.
std::vector<TestScene> LitScenes() {
  return {Diffuse(kColored), Glossy(kColored),  Outdoor(kColored),
          Hazy(kColored),    Burning(kColored), ManyLights(kColored)};
}
std::vector<TestScene> MistyScenes() { return {Foggy(kColored), Cloudy(kColored)}; }

// Each shape is invisible to rays of some kinds, and so is each lamp.
std::vector<TestScene> HidingScenes() {
  constexpr RayKinds kShapes[] = {0, BitOf(RayKind::kDiffuse), BitOf(RayKind::kShadow),
                                  BitOf(RayKind::kCamera) | BitOf(RayKind::kGlossy),
                                  kScatteredRays | BitOf(RayKind::kShadow)},
                     kLamps[] = {BitOf(RayKind::kGlossy), 0, BitOf(RayKind::kDiffuse)};
  std::vector<TestScene> scenes = {Diffuse(kColored), Glossy(kColored), ManyLights(kColored)};
  for (TestScene& t : scenes) {
    for (size_t i = 0; i < t.scene.shapes.size(); ++i) {
      t.scene.shapes[i].invisible = kShapes[i % std::size(kShapes)];
    }
    for (size_t i = 0; i < t.scene.lights.size(); ++i) {
      LightDescription& light = t.scene.lights[i];
      if (!std::holds_alternative<InfiniteLight>(light.light)) light.invisible = kLamps[i % 3];
    }
  }
  return scenes;
}

TEST(GuidedPathTest, FindWhatTheCameraFinds) {
  ExpectGuidedAgree("guided", LitScenes(), BiasOfNoisyPair(),
                    {.techniques = kGuided, .samples = 64});
}
TEST(GuidedPathTest, FindWhatTheCameraFindsInMedia) {
  ExpectGuidedAgree("guided in media", MistyScenes(), 2 * Bias(),
                    {.techniques = kGuided, .samples = 64});
}
TEST(GuidedPathTest, FindWhatTheCameraFindsInBodies) {
  ExpectGuidedAgree("guided in bodies", {Bodies(kColored)}, 2 * Bias(),
                    {.techniques = kGuided, .samples = 512, .depth = 6});
}
TEST(GuidedPathTest, FindWhatTheCameraFindsThroughASlit) {
  ExpectGuidedAgree("guided through a slit", {SlitRoom(kColored, 0.8f)}, 12 * Bias(),
                    {.techniques = kGuided, .samples = 256, .depth = 6});
}
TEST(GuidedPathTest, FindWhatTheCameraFindsInSpectra) {
  ExpectGuidedAgree("guided, spectra", LitScenes(), BiasOfNoisyPair(),
                    {.techniques = kGuided, .color = ColorTransport::kSpectral, .samples = 64});
}
TEST(GuidedPathTest, FindWhatTheCameraFindsInMediaAndBodiesInSpectra) {
  std::vector<TestScene> scenes = MistyScenes();
  scenes.push_back(Bodies(kColored));
  ExpectGuidedAgree("guided in media and bodies, spectra", scenes, 2 * Bias(),
                    {.techniques = kGuided, .color = ColorTransport::kSpectral, .samples = 64});
}
TEST(GuidedPathTest, FindWhatTheCameraFindsBesideLightPaths) {
  ExpectGuidedAgree("guided beside light paths", LitScenes(), BiasOfNoisyPair(),
                    {.techniques = kBothGuided, .samples = 64});
}
TEST(GuidedPathTest, FindWhatTheCameraFindsBesideLightPathsInMediaAndThroughASlit) {
  std::vector<TestScene> scenes = MistyScenes();
  scenes.push_back(SlitRoom(kColored, 0.8f));
  ExpectGuidedAgree("guided beside light paths, in media and through a slit", scenes, 4 * Bias(),
                    {.techniques = kBothGuided, .samples = 64});
}

TEST(GuidedPathTest, FindWhatTheCameraFindsWhereRaysSeeLess) {
  ExpectGuidedAgree("guided, kinds of rays", HidingScenes(), BiasOfNoisyPair(),
                    {.techniques = kGuided, .samples = 64});
}

TEST(LearnedLightsTest, FindWhatTheCameraFinds) {
  std::vector<TestScene> scenes = LitScenes();
  scenes.push_back(DividedHall(kColored));
  ExpectGuidedAgree("learned lights", scenes, BiasOfNoisyPair(),
                    {.techniques = kLearnedLights, .samples = 64});
}
TEST(LearnedLightsTest, FindWhatTheCameraFindsInMediaAndBodiesInSpectra) {
  std::vector<TestScene> scenes = MistyScenes();
  scenes.push_back(Bodies(kColored));
  ExpectGuidedAgree(
      "learned lights in media and bodies, spectra", scenes, 2 * Bias(),
      {.techniques = kLearnedLights, .color = ColorTransport::kSpectral, .samples = 64});
}
TEST(LearnedLightsTest, FindWhatTheCameraFindsBesideLightPathsAndGuiding) {
  const std::vector<TestScene> scenes = {ManyLights(kColored), Outdoor(kColored),
                                         DividedHall(kColored)};
  // Each comparison has images of its own: with one image by the camera, all would fail together.
  uint64_t seed = 100;
  for (const TechniqueSet others :
       {TechniqueSet::kCameraAndLight, kGuided, TechniqueSet::kCameraGuidedSplit}) {
    const TechniqueSet learned = others.With(Technique::kLearnedLights);
    seed += 1000;
    ExpectGuidedAgree(learned.Name(), scenes, BiasOfNoisyPair(),
                      {.techniques = learned, .samples = 64}, seed);
  }
}

// Rough metals, coats and principled surfaces have sketches; the hall has none.
TEST(LightsByProductTest, FindWhatTheCameraFinds) {
  const std::vector<TestScene> scenes = {LampsOverGloss(kColored, 0.4f),
                                         LampsOverPlastic(kColored, 0.4f), Glossy(kColored),
                                         DividedHall(kColored)};
  uint64_t seed = 9000;
  for (const TechniqueSet others :
       {TechniqueSet::kCamera, kLearnedLights, TechniqueSet::kCameraGuided}) {
    const TechniqueSet by_product = others.With(Technique::kProduct);
    seed += 1000;
    ExpectGuidedAgree(by_product.Name(), scenes, BiasOfNoisyPair(),
                      {.techniques = by_product, .samples = 64}, seed);
  }
}

// Where light comes through a slit alone, the variance is 2.4 times smaller.
TEST(GuidedPathTest, HaveLessNoiseWhereLightIsHardToFind) {
  const TestScene room = SlitRoom(kColored, 0.1f);
  const auto variance_by = [&](TechniqueSet techniques) {
    double sum = 0;
    for (const Estimate& estimate :
         Render(room, {.techniques = techniques, .seed = 11, .samples = Samples(64), .depth = 8})) {
      sum += estimate.variance / (estimate.mean * estimate.mean);
    }
    return sum;
  };
  const double by_camera = variance_by(TechniqueSet::kCamera), guided = variance_by(kGuided);
  std::printf("variance through a slit: %g by camera paths, %g guided\n", by_camera, guided);
  EXPECT_LT(guided, by_camera / 1.7);
}

// A field decides about noise alone: one that was learned in another scene, and is wrong almost
// everywhere, keeps the mean.
TEST(GuidedPathTest, FieldsOfOtherScenesKeepTheMean) {
  const Rendering learned{.techniques = kGuided, .seed = 7};
  const std::vector<TestScene> scenes = {Diffuse(kColored), Outdoor(kColored), Hazy(kColored)};
  const std::vector<TestScene> teachers = {SlitRoom(kColored, 0.5f), Diffuse(kColored),
                                           Outdoor(kColored)};
  std::vector<TilePair> tiles;
  for (size_t i = 0; i < scenes.size(); ++i) {
    const CompiledScenePtr teacher = CompileFor(teachers[i], learned);
    ASSERT_TRUE(EnsureGuiding(*teacher, {}).ok());
    const uint64_t samples = Samples(64);
    const CompiledScenePtr guided =
        CompileFor(scenes[i], {.techniques = kGuided, .seed = 201 + 2 * i, .samples = samples});
    const LearnedFields& fields = *teacher->guiding->fields();
    // Lights are numbered by scene.
    ASSERT_TRUE(guided->guiding
                    ->SetOnce([&] {
                      return absl::StatusOr<LearnedFields>(LearnedFields{fields.directions, {}});
                    })
                    .ok());
    const std::vector<Estimate> of_a = Render(scenes[i], {.seed = 200 + 2 * i, .samples = samples}),
                                of_b = EstimatesOfBoth(RenderBothFilms(*guided));
    for (size_t tile = 0; tile < of_a.size(); ++tile) tiles.push_back({of_a[tile], of_b[tile]});
  }
  ExpectAgreement("guided by fields of other scenes", 2 * Bias(), tiles);
}

}  // namespace
}  // namespace sheaf::render
