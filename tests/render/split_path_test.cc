// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests that paths which are split find the same light as camera paths, whatever the field has
// learned of their contributions, and that their number is bounded.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>
#include <vector>

#include "tests/support/frame_estimates.h"
#include "tests/support/guided_scenes.h"
#include "worker/render/guiding/contribution_statistics.h"
#include "worker/render/guiding_training.h"
#include "worker/render/integrator/path_splits.h"
#include "worker/render/scene/compiled_scene.h"
#include "worker/render/traits/variant_list.h"

namespace sheaf::render {
namespace {

using sheaf::testing::Bias;
using sheaf::testing::BiasOfNoisyPair;
using sheaf::testing::ExpectAgreement;
using sheaf::testing::kSizePx;
using sheaf::testing::Samples;
using sheaf::testing::TilePair;
using testing::Estimate;

constexpr Tint kColors{1};

struct SplitRendering {
  TechniqueSet techniques = TechniqueSet::kCameraGuidedSplit;
  ColorTransport color = ColorTransport::kRgb;
  uint64_t seed = 0, samples = 64;
  int32_t depth = 4;
};

CompiledScenePtr CompileToSplit(const TestScene& scene, const SplitRendering& rendering) {
  FrameSettings settings = SquareSettings(kSizePx, rendering.samples, rendering.depth);
  settings.seed = rendering.seed;
  settings.color = rendering.color;
  settings.techniques = rendering.techniques;
  return Compile(scene.scene, settings, {.training_paths_first = 4096});
}

// The split frames of the scenes have the mean of camera paths alone.
void ExpectSplitAgree(const std::string& name, const std::vector<TestScene>& scenes, double bias,
                      SplitRendering split) {
  split.seed = 101;
  split.samples = Samples(split.samples);
  SplitRendering camera = split;
  camera.techniques = TechniqueSet::kCamera;
  camera.seed = 100;
  std::vector<TilePair> tiles;
  for (const TestScene& scene : scenes) {
    const CompiledScenePtr by_camera = CompileToSplit(scene, camera),
                           by_split = CompileToSplit(scene, split);
    const std::vector<Estimate> of_camera = EstimatesOfBoth(RenderBothFilms(*by_camera)),
                                of_split = EstimatesOfBoth(RenderBothFilms(*by_split));
    EXPECT_FALSE(by_split->guiding->fields()->contributions.empty());
    for (size_t i = 0; i < of_camera.size(); ++i) tiles.push_back({of_camera[i], of_split[i]});
    camera.seed += 2;
    split.seed += 2;
  }
  ExpectAgreement(name, bias, tiles);
}

TEST(SplitPathTest, FindWhatTheCameraFinds) {
  ExpectSplitAgree("split", {Diffuse(kColors), Glossy(kColors), Outdoor(kColors), Hazy(kColors)},
                   BiasOfNoisyPair(), {.samples = 64});
}
TEST(SplitPathTest, FindWhatTheCameraFindsInMediaAndBodiesInSpectra) {
  ExpectSplitAgree("split in media and bodies, spectra", {Cloudy(kColors), Bodies(kColors)},
                   2 * Bias(), {.color = ColorTransport::kSpectral, .samples = 64});
}
TEST(SplitPathTest, FindWhatTheCameraFindsThroughASlitBesideLightPaths) {
  ExpectSplitAgree("split beside light paths", {Diffuse(kColors), SlitRoom(kColors, 0.8f)},
                   4 * Bias(),
                   {.techniques = TechniqueSet::kCameraAndLightGuidedSplit, .samples = 64});
}

// --- Limits --------------------------------------------------------------------------------------

using Config = IntegratorConfig<Guided(CommonTraits(false, false, false, false)), const EmbreeScene,
                                DirectLight::kByBoth>;
// A vertex of a region with the factor.
struct VertexWith {
  struct {
    float factor;
    float split_factor() const { return factor; }
  } guided;
};

TEST(SplitPathTest, NumbersAreBounded) {
  const Sampler sampler(1, 2, 3, 4);
  SplitPaths<Config> splits;
  splits.Begin(sampler, 2);
  PathState<Config> path;
  path.throughput = {0.1f, 0.5f, 0.25f};
  const auto number = [&](float factor) { return SplitNumber(splits, VertexWith{{factor}}, path); };
  EXPECT_EQ(number(3), 3);
  EXPECT_EQ(number(0), 1);
  EXPECT_EQ(number(0.5f), 1);
  EXPECT_EQ(number(1e30f), kSplitNumberMax);
  EXPECT_EQ(number(std::numeric_limits<float>::infinity()), kSplitNumberMax);
  EXPECT_EQ(number(std::numeric_limits<float>::quiet_NaN()), 1);
  while (splits.Left() > 2) splits.Push({path, splits.NextNumber()});
  EXPECT_EQ(number(8), 3);
  while (splits.Left() > 0) splits.Push({path, splits.NextNumber()});
  EXPECT_EQ(splits.waiting(), kSplitPathsWaitingMax);
  EXPECT_EQ(number(8), 1);
  uint32_t last = 0;
  while (splits.waiting() > 0) last = splits.Pop().number;
  EXPECT_EQ(last, 1u);
  for (uint32_t i = kSplitPathsWaitingMax; i < kSplitPathsOfSampleMax; ++i) {
    EXPECT_GT(number(8), 1);
    EXPECT_EQ(splits.NextNumber(), i + 1);
  }
  EXPECT_EQ(number(8), 1);
}

// Numbers of a sample's first path and of those that split off, in the same slot, over pixels.
TEST(SplitPathTest, PathsHaveIndependentNumbers) {
  constexpr int32_t kSide = 160;
  constexpr double kExpected = kSide * kSide / 64.0, kFreedoms = 63;
  for (const uint32_t number : {1u, 2u, 256u}) {
    for (size_t d = 0; d < 4; ++d) {
      std::array<int, 64> with_first{}, with_next{};
      for (int32_t y = 0; y < kSide; ++y) {
        for (int32_t x = 0; x < kSide; ++x) {
          const Sampler first(1, x, y, 17 * 16);
          const auto cell_of = [&](const Sampler& sampler) {
            return static_cast<size_t>(sampler.Get4(Slot(1, VertexSlot::kBsdf))[d] * 8);
          };
          const size_t cell = cell_of(first.OfSplitPath(number));
          ++with_first[cell_of(first) * 8 + cell];
          ++with_next[cell_of(first.OfSplitPath(number + 1)) * 8 + cell];
        }
      }
      for (const std::array<int, 64>& counts : {with_first, with_next}) {
        double chi_square = 0;
        for (const int count : counts) chi_square += (count - kExpected) * (count - kExpected);
        chi_square /= kExpected;
        EXPECT_LE((chi_square - kFreedoms) / std::sqrt(2 * kFreedoms), 5) << number << ' ' << d;
      }
    }
  }
}

// The field of the scene's training, but with contributions for which each path is split as often
// as the limits allow.
LearnedFields SplitsAlways(const CompiledScene& scene) {
  EXPECT_TRUE(EnsureGuiding(scene, {}).ok());
  LearnedFields fields = *scene.guiding->fields();
  const auto regions = static_cast<uint32_t>(fields.directions.region_count());
  ContributionStatistics statistics(regions, ContributionGridFor(kSizePx, kSizePx, 1), 0);
  for (const double light : {0.0, 1.0}) {
    for (uint32_t i = 0; i < regions; ++i) statistics.AddVertex(i, light * 0x1p30, 1);
    statistics.AddPath(0, 0, light * 0x1p13, 1);
  }
  fields.contributions = statistics.Freeze();
  return fields;
}

// At the limits too, the mean is that of camera paths, by the errors that the replicates tell.
TEST(SplitPathTest, LimitsKeepTheMeanAndBoundTheWork) {
  constexpr int32_t kDepth = 6, kPixels = 8;
  for (const TestScene& scene : {Diffuse(kColors), Glossy(kColors)}) {
    FrameSettings settings = SquareSettings(kPixels, Samples(64), kDepth);
    settings.techniques = TechniqueSet::kCameraGuidedSplit;
    const CompiledScenePtr teacher = Compile(scene.scene, settings, kSmallTraining),
                           split = Compile(scene.scene, settings, kSmallTraining);
    ASSERT_TRUE(split->guiding
                    ->SetOnce([&] { return absl::StatusOr<LearnedFields>(SplitsAlways(*teacher)); })
                    .ok());
    RenderStats stats;
    const TileMean by_split = MeanOf(RenderAll(*split, &stats));
    settings.techniques = TechniqueSet::kCamera;
    settings.samples *= 16;
    settings.seed = 5;
    const TileMean by_camera = MeanOf(RenderAll(*Compile(scene.scene, settings)));
    for (size_t i = 0; i < 3; ++i) {
      const float error = std::hypot(by_split.standard_error[i], by_camera.standard_error[i]);
      EXPECT_NEAR(by_split.mean[i], by_camera.mean[i], 5 * error);
      EXPECT_LT(error, 0.02f * by_camera.mean[i]);
    }
    const double rays = static_cast<double>(stats.rays) / static_cast<double>(stats.samples);
    std::printf("split as often as allowed: %.0f rays a sample\n", rays);
    // A ray to each vertex and beyond the last, and one to a light at each.
    EXPECT_LE(rays, (kSplitPathsOfSampleMax + 1) * (2 * kDepth + 1));
    EXPECT_GT(rays, 8 * (2 * kDepth + 1));
  }
}

}  // namespace
}  // namespace sheaf::render
