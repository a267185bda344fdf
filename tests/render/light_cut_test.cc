// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Cuts of a LightTree and of a LightChoice: each part is a distribution over its lights, no light
// that is seen is left out, and the parts have less variance than a single choice.
// tests/stability/light_cut_stability_test.cc has the hard cases.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <set>
#include <vector>

#include "tests/support/random_lights.h"
#include "worker/render/light/choice/light_choice.h"
#include "worker/render/light/choice/light_tree.h"

namespace sheaf::render {
namespace {

using Cut = LightTree::Cut;

// Points among the lights, on one, and far off.
Vec3f PointAmong(const std::vector<LightBounds>& lights, int i, Random* random) {
  if (i % 4 == 1) return lights[static_cast<size_t>(i) % lights.size()].center;
  return random->Vector(i % 4 == 2 ? 1e4f : 10);
}

template <typename Row>
void ExpectPartsAreDistributions(const LightTree& tree, size_t count, Vec3f p, Vec3f n,
                                 size_t parts_max, Row row) {
  const Cut cut = tree.CutAt(p, n, parts_max, row);
  ASSERT_LE(cut.size(), parts_max);
  ASSERT_EQ(cut.size() > 0, tree.Irradiance(p, n, row) > 0);
  double sum = 0;
  for (uint32_t light = 0; light < count; ++light) {
    const auto probability = static_cast<double>(tree.ProbabilityIn(cut, light, p, n, row));
    sum += probability;
    // Without a normal all lights are seen. With one, the bounds of a node may tell that it sends
    // nothing.
    EXPECT_TRUE(probability > 0 || n != Vec3f{} || cut.size() == 0) << light;
  }
  EXPECT_NEAR(sum, static_cast<double>(cut.size()), 1e-5 * static_cast<double>(parts_max));
  for (size_t part = 0; part < cut.size(); ++part) {
    for (const double u : {0.0, 0.3, 0.7, 1 - 0x1p-53}) {
      const ChosenLight chosen = tree.ChooseFrom(cut, part, p, n, u, row);
      ASSERT_EQ(chosen.probability, tree.ProbabilityIn(cut, chosen.light, p, n, row));
      ASSERT_GT(chosen.probability, 0);
    }
  }
}

TEST(LightCutTest, PartsAreDistributions) {
  for (const size_t count : {1u, 2u, 8u, 9u, 64u, 1000u}) {
    std::vector<LightBounds> lights = MakeLights(count, count);
    // All of these send light everywhere.
    for (LightBounds& light : lights) {
      if (light.kind == LightBounds::Kind::kPlanar) light.two_sided = true;
      light.cos_end = -1;
    }
    const LightTree tree(lights, true);
    Random random(7);
    for (int i = 0; i < 40; ++i) {
      const Vec3f p = PointAmong(lights, i, &random), n = i % 3 == 0 ? Vec3f{} : random.Direction();
      const size_t parts_max = 1 + static_cast<size_t>(i) % LightTree::kPartsMax;
      ExpectPartsAreDistributions(tree, count, p, n, parts_max, NoLightVisibilityRow{});
      const std::vector<uint8_t> steps =
          RandomSteps(tree.visibility_slot_count(), static_cast<uint64_t>(i));
      ExpectPartsAreDistributions(tree, count, p, n, parts_max, LightVisibilityRow{steps.data()});
    }
  }
}

// Point lights that are above the horizon are in a part.
TEST(LightCutTest, NoLightThatIsSeenIsLeftOut) {
  std::vector<LightBounds> lights = MakeLights(500, 31);
  for (LightBounds& light : lights) {
    light.kind = LightBounds::Kind::kPoint;
    light.radius = light.area = 0;
    light.cos_end = -1;
  }
  const LightTree tree(lights, true);
  Random random(32);
  int seen = 0, hidden = 0;
  for (int i = 0; i < 100; ++i) {
    const Vec3f p = PointAmong(lights, i, &random), n = random.Direction();
    const Cut cut = tree.CutAt(p, n, LightTree::kPartsMax);
    for (uint32_t light = 0; light < lights.size(); ++light) {
      const bool is_seen = Dot(ToDouble(lights[light].center) - ToDouble(p), ToDouble(n)) > 0;
      const float probability = tree.ProbabilityIn(cut, light, p, n);
      ASSERT_TRUE(probability > 0 || !is_seen) << light;
      (is_seen ? seen : hidden) += probability > 0 ? 1 : 0;
    }
  }
  EXPECT_GT(seen, 10 * hidden);
}

// Draws of each part, as often as their probabilities say; each light from one part only.
TEST(LightCutTest, DrawsMatchProbabilities) {
  constexpr size_t kCount = 300;
  constexpr int kDraws = 1 << 14;
  const LightTree tree(MakeLights(kCount, 3), true);
  Random random(8);
  for (int k = 0; k < 4; ++k) {
    const Vec3f p = random.Vector(10), n = k % 2 == 0 ? Vec3f{} : random.Direction();
    const Cut cut = tree.CutAt(p, n, 8);
    EXPECT_GE(cut.size(), 4u);
    std::vector<int> counts(kCount), part_of(kCount, -1);
    for (size_t part = 0; part < cut.size(); ++part) {
      for (int i = 0; i < kDraws; ++i) {
        const uint32_t light = tree.ChooseFrom(cut, part, p, n, (i + 0.5) / kDraws).light;
        ++counts[light];
        if (part_of[light] < 0) part_of[light] = static_cast<int>(part);
        ASSERT_EQ(part_of[light], static_cast<int>(part));
      }
    }
    for (uint32_t i = 0; i < kCount; ++i) {
      ASSERT_NEAR(counts[i], static_cast<double>(tree.ProbabilityIn(cut, i, p, n)) * kDraws, 1.01);
    }
  }
}

// The variance of light from small lamps above a floor, by exact moments: of a sample of each part,
// as a fraction of that of as many independent samples. is_hidden(light, p): from the point.
template <typename IsHidden>
double VarianceRatio(size_t parts_max, const IsHidden& is_hidden) {
  constexpr size_t kCount = 1000;
  constexpr int kPoints = 8, kDraws = 1 << 12;
  std::vector<LightBounds> lights;
  Random random(5);
  for (size_t i = 0; i < kCount; ++i) {
    LightBounds light;
    light.kind = LightBounds::Kind::kPoint;
    light.center = {random.Between(-5, 5), random.Between(-5, 5), random.Between(0.2f, 1)};
    light.strength = random.Between(0.5f, 2);
    lights.push_back(light);
  }
  const LightTree tree(lights, true);
  const Vec3f n{0, 0, 1};
  double ratio = 0;
  for (int i = 0; i < kPoints; ++i) {
    const Vec3f p{random.Between(-5, 5), random.Between(-5, 5), 0};
    const Cut cut = tree.CutAt(p, n, parts_max);
    std::vector<size_t> part_of(kCount, cut.size());
    for (size_t part = 0; part < cut.size(); ++part) {
      for (int k = 0; k < kDraws; ++k) {
        part_of[tree.ChooseFrom(cut, part, p, n, (k + 0.5) / kDraws).light] = part;
      }
    }
    std::vector<double> sums(cut.size());
    double one = 0, parts = 0;
    for (uint32_t light = 0; light < kCount; ++light) {
      // Those that no draw found are too unlikely to matter.
      if (part_of[light] == cut.size() || is_hidden(lights[light].center, p)) continue;
      const Vec3d d = ToDouble(lights[light].center) - ToDouble(p);
      const double value =
          static_cast<double>(lights[light].strength) * d.z / (LengthSquared(d) * Length(d));
      sums[part_of[light]] += value;
      one += value * value / static_cast<double>(tree.Probability(light, p, n));
      parts += value * value / static_cast<double>(tree.ProbabilityIn(cut, light, p, n));
    }
    double sum = 0;
    for (const double of_part : sums) {
      sum += of_part;
      parts -= of_part * of_part;
    }
    ratio += parts / ((one - sum * sum) / static_cast<double>(cut.size())) / kPoints;
  }
  return ratio;
}

TEST(LightCutTest, PartsHaveLessVarianceThanAsManySamples) {
  const auto none = [](Vec3f, Vec3f) { return false; };
  // A wall hides one side.
  const auto side = [](Vec3f light, Vec3f p) { return light.x > p.x; };
  const double open = VarianceRatio(8, none), beside_wall = VarianceRatio(8, side);
  std::printf("variance of 8 parts %.3f, beside a wall %.3f of that of as many samples\n", open,
              beside_wall);
  EXPECT_LT(open, 0.5);
  EXPECT_LT(beside_wall, 0.9);
}

TEST(LightCutTest, DarkPartsTakeNoSamples) {
  std::vector<LightBounds> lights = MakeLights(200, 4);
  for (LightBounds& light : lights) light.strength *= 1e-6f;
  lights[17] = {.kind = LightBounds::Kind::kPoint, .center = {0, 0, 3}, .strength = 1000};
  const LightTree tree(lights, true);
  const Cut cut = tree.CutAt({0, 0, 0}, {}, 16);
  EXPECT_EQ(cut.size(), 1u);
  EXPECT_GT(tree.ProbabilityIn(cut, 17, {0, 0, 0}, {}), 0.9f);
}

TEST(LightCutTest, ScaleByAPowerOfTwoChangesNoBit) {
  constexpr size_t kCount = 300;
  for (const int exponent : {-20, 20}) {
    const float size = std::ldexp(1.0f, exponent);
    std::vector<LightBounds> lights = MakeLights(kCount, 21), scaled = MakeLights(kCount, 21, size);
    for (LightBounds& light : scaled) light.strength *= std::ldexp(1.0f, -exponent);
    const LightTree tree(lights, true), scaled_tree(scaled, true);
    Random random(22);
    for (int i = 0; i < 40; ++i) {
      const Vec3f p = PointAmong(lights, i, &random), n = random.Direction();
      const Cut cut = tree.CutAt(p, n, 16), scaled_cut = scaled_tree.CutAt(p * size, n, 16);
      ASSERT_EQ(cut.size(), scaled_cut.size());
      for (uint32_t light = 0; light < kCount; ++light) {
        ASSERT_EQ(tree.ProbabilityIn(cut, light, p, n),
                  scaled_tree.ProbabilityIn(scaled_cut, light, p * size, n));
      }
    }
  }
}

// --- All lights ----------------------------------------------------------------------------------

LightBounds InfiniteOf(float strength) {
  return {.kind = LightBounds::Kind::kInfinite, .strength = strength};
}

TEST(LightCutTest, InfiniteLightsAreOnePart) {
  for (const size_t local : {0u, 1u, 5u, 40u}) {
    std::vector<LightBounds> lights = MakeLights(local, 9);
    for (LightBounds& light : lights) light.cos_end = -1;
    lights.push_back(InfiniteOf(1));
    lights.push_back(InfiniteOf(3));
    const LightChoice choice(lights, true);
    ASSERT_TRUE(choice.splits());
    const auto sky = static_cast<uint32_t>(local);
    // Before the first light, which emits to one side.
    const Vec3f p = local == 0 ? Vec3f{} : lights[0].center + lights[0].normal;
    const LightCut cut = choice.CutAt(p, {}, 4);
    ASSERT_LE(cut.size(), 4u);
    ASSERT_TRUE(cut.has_infinite);
    std::set<uint32_t> chosen;
    for (size_t part = 0; part < cut.size(); ++part) {
      for (int i = 0; i < 64; ++i) {
        const float u = (static_cast<float>(i) + 0.5f) / 64;
        const ChosenLight light = choice.ChooseFrom(cut, part, p, {}, u, 0);
        chosen.insert(light.light);
        EXPECT_EQ(light.light >= sky, part == 0);
        EXPECT_EQ(
            light.probability,
            choice.Probability(light.light, p, {}, SplitLightQuery<NoLightVisibilityRow>{{}, 4}));
      }
    }
    EXPECT_TRUE(chosen.count(sky) == 1 && chosen.count(sky + 1) == 1);
    EXPECT_EQ(chosen.size() > 2, local > 0);
  }
}

TEST(LightCutTest, QueriesForOneSampleAreSingleChoices) {
  const std::vector<LightBounds> lights = MakeLights(40, 10);
  const LightChoice choice(lights), split(lights, true);
  const std::vector<uint8_t> steps = RandomSteps(choice.visibility_slot_count(), 1);
  const LightVisibilityRow row{steps.data()};
  Random random(11);
  for (int i = 0; i < 100; ++i) {
    const Vec3f p = random.Vector(10), n = random.Direction();
    const auto light = static_cast<uint32_t>(i % 40);
    const float expected = choice.Probability(light, p, n, row);
    EXPECT_EQ(split.Probability(light, p, n, SplitLightQuery<LightVisibilityRow>{row, 1}),
              expected);
    EXPECT_EQ(choice.Probability(light, p, n, SplitLightQuery<LightVisibilityRow>{row, 8}),
              expected)
        << "a choice that was not built for splits";
    EXPECT_EQ(split.Probability(light, p, n, SplitLightQuery<LightVisibilityRow>{{}, 8}),
              split.Probability(light, p, n, SplitLightQuery<NoLightVisibilityRow>{{}, 8}))
        << "a row that knows nothing";
  }
}

TEST(LightCutTest, SingleLightsAndNoneAreNotSplit) {
  EXPECT_FALSE(LightChoice({}, true).splits());
  const LightChoice one(MakeLights(1, 1), true);
  EXPECT_FALSE(one.splits());
  EXPECT_EQ(one.Probability(0, {}, {}, SplitLightQuery<NoLightVisibilityRow>{{}, 8}), 1);
  EXPECT_TRUE(LightChoice(MakeLights(2, 1), true).splits());
}

}  // namespace
}  // namespace sheaf::render
