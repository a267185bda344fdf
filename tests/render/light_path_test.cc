// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests that paths from lights find the same light as paths from the camera: camera paths alone,
// both kinds combined, and light paths wherever they can find the light.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/support/emissive_scenes.h"
#include "tests/support/light_film_sums.h"
#include "tests/support/technique_agreement.h"
#include "tests/support/technique_scenes.h"
#include "tests/support/test_scene.h"

namespace sheaf::render {
namespace {

using sheaf::testing::Bias;
using sheaf::testing::EstimatesOfTiles;
using sheaf::testing::ExpectAgreement;
using sheaf::testing::kSizePx;
using sheaf::testing::Samples;
using sheaf::testing::TilePair;
using testing::Estimate;

constexpr int32_t kDepth = 4;

struct Rendering {
  TechniqueSet techniques = TechniqueSet::kCamera;
  ColorTransport color = ColorTransport::kRgb;
  uint64_t seed = 0, samples = 64;
};

std::vector<Estimate> Render(const TestScene& test_scene, const Rendering& rendering) {
  FrameSettings settings = SquareSettings(kSizePx, rendering.samples, kDepth);
  settings.seed = rendering.seed;
  settings.color = rendering.color;
  settings.techniques = rendering.techniques;
  const BothFilms films = RenderBothFilms(*Compile(test_scene.scene, settings));
  return EstimatesOfTiles(
      kReplicateCount,
      [&](uint32_t r, size_t pixel) {
        return films.Mean(r, 0, pixel) + films.Mean(r, 1, pixel) + films.Mean(r, 2, pixel);
      },
      [](uint32_t, size_t) { return 1.0; });
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

void ExpectLightPathsAgree(const std::string& name, const std::vector<TestScene>& scenes,
                           double bias, TechniqueSet techniques, uint64_t samples,
                           ColorTransport color = ColorTransport::kRgb) {
  ExpectAgreement(
      name, bias,
      TilePairs(
          scenes, {.color = color, .seed = 100, .samples = Samples(samples)},
          {.techniques = techniques, .color = color, .seed = 101, .samples = Samples(samples)}));
}

constexpr Tint kColored{1};
constexpr TechniqueSet kBoth = TechniqueSet::kCameraAndLight, kAlone = TechniqueSet::kLight;

// Every kind of light, and lens, motion, cut-outs, media.
std::vector<TestScene> LitScenes(Tint tint) {
  return {Diffuse(tint), Glossy(tint), Outdoor(tint), Hazy(tint), Burning(tint), ManyLights(tint)};
}
std::vector<TestScene> MistyScenes() { return {Foggy(kColored), Cloudy(kColored)}; }
// Emissive media alone: seen, around diffuse surfaces, and behind glass.
std::vector<TestScene> EmissiveScenes() { return {Lamps(kColored), Lanterns(kColored)}; }

TEST(LightPathTest, BothKindsFindWhatTheCameraFinds) {
  ExpectLightPathsAgree("both", LitScenes(kColored), Bias(), kBoth, 64);
}
TEST(LightPathTest, BothKindsFindWhatTheCameraFindsInMedia) {
  ExpectLightPathsAgree("both in media", MistyScenes(), 2 * Bias(), kBoth, 128);
}
TEST(LightPathTest, BothKindsFindWhatTheCameraFindsInSpectra) {
  ExpectLightPathsAgree("both, spectra", LitScenes(kColored), Bias(), kBoth, 64,
                        ColorTransport::kSpectral);
}
TEST(LightPathTest, LightPathsFindWhatTheCameraFinds) {
  ExpectLightPathsAgree("light paths", LitScenes(kColored), 4 * Bias(), kAlone, 128);
}
TEST(LightPathTest, LightPathsFindWhatTheCameraFindsInMedia) {
  ExpectLightPathsAgree("light paths in media", MistyScenes(), 6 * Bias(), kAlone, 256);
}
TEST(LightPathTest, LightPathsFindWhatTheCameraFindsInSpectra) {
  ExpectLightPathsAgree("light paths, spectra", LitScenes(kColored), 4 * Bias(), kAlone, 128,
                        ColorTransport::kSpectral);
}
TEST(LightPathTest, BothKindsFindWhatMediaEmit) {
  ExpectLightPathsAgree("both, emissive media", EmissiveScenes(), 2 * Bias(), kBoth, 64);
}
TEST(LightPathTest, LightPathsFindWhatMediaEmit) {
  ExpectLightPathsAgree("light paths, emissive media", EmissiveScenes(), 4 * Bias(), kAlone, 64);
}
TEST(LightPathTest, LightPathsFindWhatMediaEmitInSpectra) {
  ExpectLightPathsAgree("light paths, emissive media, spectra", EmissiveScenes(), 4 * Bias(),
                        kAlone, 64, ColorTransport::kSpectral);
}

// Light paths bring a good part of the light where nothing but media emits, also through glass.
TEST(LightPathTest, LightPathsBeginInMedia) {
  FrameSettings settings = SquareSettings(16, 16, kDepth);
  settings.techniques = kAlone;
  for (const TestScene& scene : EmissiveScenes()) {
    const BothFilms films = RenderBothFilms(*Compile(scene.scene, settings));
    EXPECT_GT(MeanOf(*films.light).mean.g, 0.05f * MeanOf(films.camera).mean.g);
  }
}

// Media in their reduced form begin after a number of scatterings from the camera, which a path
// from a light cannot know.
TEST(LightPathTest, SimilarityIsRefused) {
  FrameSettings settings = SquareSettings(4, 1, kDepth);
  settings.techniques = kBoth;
  settings.similarity_after = 2;
  TableFileSource files({});
  const absl::StatusOr<CompiledScenePtr> scene =
      CompileScene(Foggy(kColored).scene, settings, files);
  EXPECT_EQ(scene.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(scene.status().message(), ::testing::HasSubstr("similarity"));
}

}  // namespace
}  // namespace sheaf::render
