// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests frames with chains of mutations: that they have the expectation of samples alone
// (technique_agreement.h says how they are compared), and that passes are pure functions.
// mutation_chain_test.cc tests chains without a scene.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "common/film/tile_tree.h"
#include "tests/support/technique_agreement.h"
#include "tests/support/technique_scenes.h"
#include "tests/support/test_scene.h"
#include "worker/render/mutations/mutation_passes.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {
namespace {

using sheaf::testing::BiasOfNoisyPair;
using sheaf::testing::Estimate;
using sheaf::testing::EstimatesOf;
using sheaf::testing::ExpectAgreement;
using sheaf::testing::kSizePx;
using sheaf::testing::Samples;
using sheaf::testing::TilePair;

constexpr TechniqueSet kMutations{Technique::kMutations};
constexpr Tint kMutatedTint{1};

FrameSettings MutationSettings(int32_t size_px, uint64_t samples,
                               TechniqueSet techniques = kMutations) {
  FrameSettings settings = SquareSettings(size_px, samples, 4);
  settings.techniques = techniques;
  return settings;
}

// Thresholds at twice the mean: many samples of the test's images, which are less noisy than those
// that need mutations, start chains. These are short, since a chain of any length has the mean.
ChainRules ManyChains(const CompiledScene& scene) {
  RayCounts counts;
  ChainRules rules = ChainRulesOf(scene, &counts);
  for (double& threshold : rules.thresholds) threshold *= 2 / kBrightOverMean;
  rules.states = 8;
  return rules;
}

FilmTile RenderBlock(const CompiledScene& scene, const ChainRules& rules, SampleBlock block) {
  RayCounts counts;
  std::vector<PixelAccumulator::NonFinite> lost;
  absl::StatusOr<FilmTile> film = RenderMutationPasses(scene, rules, block, {}, &counts, &lost);
  EXPECT_TRUE(film.ok() && lost.empty());
  return *std::move(film);
}

void ExpectAsSamplesAlone(const std::string& name, const std::vector<TestScene>& scenes,
                          uint64_t samples, ColorTransport color = ColorTransport::kRgb) {
  std::vector<TilePair> tiles;
  uint64_t seed = 4000;
  for (const TestScene& scene : scenes) {
    const auto compile = [&](TechniqueSet set) {
      FrameSettings settings = MutationSettings(kSizePx, Samples(samples), set);
      settings.seed = seed++;
      settings.color = color;
      return Compile(scene.scene, settings);
    };
    const CompiledScenePtr chains = compile(kMutations);
    const std::vector<Estimate> mutated =
        EstimatesOf(RenderBlock(*chains, ManyChains(*chains), {0, Samples(samples)}));
    const std::vector<Estimate> alone = EstimatesOf(RenderAll(*compile(TechniqueSet::kCamera)));
    for (size_t t = 0; t < alone.size(); ++t) tiles.push_back({alone[t], mutated[t]});
  }
  ExpectAgreement(name, BiasOfNoisyPair(), tiles);
}

TEST(MutationsTest, ChainsOfOneStateAreSamplesAlone) {
  for (const uint64_t samples : {1, 16, 64}) {
    const TestScene test = Glossy(kMutatedTint);
    const CompiledScenePtr scene = Compile(test.scene, MutationSettings(40, samples));
    const CompiledScenePtr camera =
        Compile(test.scene, MutationSettings(40, samples, TechniqueSet::kCamera));
    const FilmTile alone = RenderAll(*camera);
    ChainRules rules = ManyChains(*scene);
    EXPECT_FALSE(RenderBlock(*scene, rules, {0, samples}) == alone) << samples;
    rules.states = 1;
    EXPECT_TRUE(RenderBlock(*scene, rules, {0, samples}) == alone) << samples;
  }
}

TEST(MutationsTest, BlocksOfPassesAddUp) {
  const CompiledScenePtr scene = Compile(Glossy(kMutatedTint).scene, MutationSettings(40, 32));
  const ChainRules rules = ManyChains(*scene);
  TileTree tree({0, 0, 40, 40});
  for (const SampleBlock block : {SampleBlock{16, 16}, SampleBlock{8, 8}, SampleBlock{0, 8}}) {
    ASSERT_TRUE(tree.Insert(RenderBlock(*scene, rules, block)).ok());
  }
  EXPECT_TRUE(tree.nodes().at(0) == RenderBlock(*scene, rules, {0, 32}));
}

TEST(MutationsTest, AFurnaceIsWhite) {
  TestScene test({0, 0, -3}, {0, 0, 0}, 50);
  test.ConstantEnvironment(Rgb::Gray(1));
  test.AddShape(SphereShape{1, -1, 1, 360}, test.Diffuse(Rgb::Gray(1)));
  FrameSettings settings = MutationSettings(16, 64);
  settings.max_depth = 100;
  ExpectMean(MeanOf(RenderAll(*Compile(test.scene, settings))), Rgb::Gray(1));
}

// Thresholds follow the regions' means, and depend on no unit of length.
TEST(MutationsTest, ThresholdsAreOfTheLight) {
  RayCounts counts;
  const auto thresholds = [&counts](double scale) {
    return ChainRulesOf(*Compile(LitRoom(scale).scene, MutationSettings(80, 1)), &counts)
        .thresholds;
  };
  const std::vector<double> once = thresholds(1), scaled = thresholds(4);
  ASSERT_EQ(once.size(), 9u);
  for (size_t region = 0; region < once.size(); ++region) {
    EXPECT_GT(once[region], 0);
    EXPECT_NEAR(scaled[region] / once[region], 1, 1e-4) << region;
  }
  TestScene dark({0, 0, -3}, {0, 0, 0}, 50);
  dark.AddShape(SphereShape{1, -1, 1, 360}, dark.Diffuse(Rgb::Gray(1)));
  EXPECT_TRUE(
      ChainRulesOf(*Compile(dark.scene, MutationSettings(80, 1)), &counts).thresholds.empty());
}

TEST(MutationsTest, ImagesAreAsOfSamplesAlone) {
  ExpectAsSamplesAlone("mutations", {Diffuse(kMutatedTint), Glossy(kMutatedTint)}, 256);
}
TEST(MutationsTest, OpenScenesAreAsOfSamplesAlone) {
  ExpectAsSamplesAlone("mutations of sky, cut-outs, motion, media",
                       {Outdoor(kMutatedTint), Hazy(kMutatedTint), Foggy(kMutatedTint)}, 128);
}
TEST(MutationsTest, SpectralFramesAreAsOfSamplesAlone) {
  ExpectAsSamplesAlone("mutations of spectra", {Glossy(kMutatedTint)}, 256,
                       ColorTransport::kSpectral);
}

}  // namespace
}  // namespace sheaf::render
