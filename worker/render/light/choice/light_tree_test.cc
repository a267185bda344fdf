// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightTree as a distribution over lights: its sum, its agreement with walks, and its invariances.
// tests/stability/light_tree_stability_test.cc has the hard cases.
#include "worker/render/light/choice/light_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "tests/support/random_lights.h"

namespace sheaf::render {
namespace {

double SumOfProbabilities(const LightTree& tree, size_t count, Vec3f p, Vec3f n) {
  double sum = 0;
  for (uint32_t i = 0; i < count; ++i) sum += static_cast<double>(tree.Probability(i, p, n));
  return sum;
}

TEST(LightTreeTest, ProbabilitiesSumToOneWhereAnyLightArrives) {
  for (size_t count : {1u, 2u, 8u, 9u, 64u, 65u, 3000u}) {
    const std::vector<LightBounds> lights = MakeLights(count, count);
    const LightTree tree(lights);
    Random random(7);
    for (int i = 0; i < 100; ++i) {
      // Among the lights, on one, far off, and too far for float to separate them.
      Vec3f p = random.Vector(10);
      if (i % 4 == 1) p = lights[static_cast<size_t>(i) % count].center;
      if (i % 4 == 2) p = random.Vector(1e4f);
      if (i % 4 == 3) p = random.Vector(1e15f);
      const Vec3f n = i % 3 == 0 ? Vec3f{} : random.Direction();
      const double expected = tree.Irradiance(p, n) > 0 ? 1 : 0;
      ASSERT_NEAR(SumOfProbabilities(tree, count, p, n), expected, 1e-5) << count << " " << i;
      ASSERT_EQ(tree.Choose(p, n, 0.5).has_value(), expected > 0);
    }
  }
}

TEST(LightTreeTest, WalksMatchProbabilitiesExactly) {
  constexpr size_t kCount = 300;
  constexpr int kDraws = 1 << 16;
  const LightTree tree(MakeLights(kCount, 3));
  Random random(8);
  for (int k = 0; k < 6; ++k) {
    const Vec3f p = random.Vector(10), n = k % 2 == 0 ? Vec3f{} : random.Direction();
    std::vector<int> counts(kCount);
    for (int i = 0; i < kDraws; ++i) {
      const auto chosen = tree.Choose(p, n, (i + 0.5) / kDraws);
      ASSERT_TRUE(chosen.has_value());
      ASSERT_EQ(chosen->probability, tree.Probability(chosen->light, p, n));
      ++counts[chosen->light];
    }
    for (uint32_t i = 0; i < kCount; ++i) {
      ASSERT_NEAR(counts[i], static_cast<double>(tree.Probability(i, p, n)) * kDraws, 1.01);
    }
  }
}

TEST(LightTreeTest, WalksWithLearnedFactorsMatchProbabilitiesExactly) {
  constexpr int kDraws = 1 << 14;
  for (size_t count : {1u, 8u, 9u, 300u, 5000u}) {
    const LightTree tree(MakeLights(count, 3));
    Random random(8);
    for (uint64_t k = 0; k < 4; ++k) {
      const Vec3f p = random.Vector(10), n = k % 2 == 0 ? Vec3f{} : random.Direction();
      if (!(tree.Irradiance(p, n) > 0)) continue;
      const std::vector<uint8_t> steps = RandomSteps(tree.visibility_slot_count(), k);
      const LightVisibilityRow row{steps.data()};
      const double irradiance = tree.Irradiance(p, n), learned = tree.Irradiance(p, n, row);
      EXPECT_TRUE(learned <= irradiance && learned >= irradiance / 16);
      std::vector<int> counts(count);
      for (int i = 0; i < kDraws; ++i) {
        const auto chosen = tree.Choose(p, n, (i + 0.5) / kDraws, row);
        ASSERT_TRUE(chosen.has_value());
        ASSERT_EQ(chosen->probability, tree.Probability(chosen->light, p, n, row));
        ++counts[chosen->light];
      }
      double sum = 0;
      for (uint32_t i = 0; i < count; ++i) {
        const auto probability = static_cast<double>(tree.Probability(i, p, n, row));
        sum += probability;
        ASSERT_NEAR(counts[i], probability * kDraws, 1.01);
        ASSERT_EQ(probability > 0, tree.Probability(i, p, n) > 0);
      }
      EXPECT_NEAR(sum, 1, 1e-5);
    }
  }
}

TEST(LightTreeTest, FactorsOfOneChangeNoBit) {
  constexpr size_t kCount = 3000;
  const LightTree tree(MakeLights(kCount, 12));
  const std::vector<uint8_t> steps(tree.visibility_slot_count(), kVisibilityStepOfOne);
  const LightVisibilityRow row{steps.data()};
  Random random(13);
  for (int i = 0; i < 300; ++i) {
    const Vec3f p = random.Vector(12), n = i % 2 == 0 ? Vec3f{} : random.Direction();
    const double u = static_cast<double>(random.Between(0, 1));
    ASSERT_EQ(tree.Irradiance(p, n), tree.Irradiance(p, n, row));
    const auto a = tree.Choose(p, n, u), b = tree.Choose(p, n, u, row);
    ASSERT_EQ(a.has_value(), b.has_value());
    if (!a) continue;
    ASSERT_EQ(a->light, b->light);
    ASSERT_EQ(a->probability, b->probability);
    ASSERT_EQ(tree.Probability(b->light, p, n), tree.Probability(b->light, p, n, row));
  }
}

TEST(LightTreeTest, SlotsLeadFromTheLightToTheRoot) {
  for (size_t count : {1u, 8u, 9u, 100u, 5000u}) {
    const LightTree tree(MakeLights(count, 14));
    EXPECT_LE(tree.visibility_slot_count(), LightTree::kVisibilityNodesMax * LightTree::kWidth);
    std::vector<bool> is_visited(tree.visibility_slot_count());
    for (uint32_t i = 0; i < count; ++i) {
      size_t last = tree.visibility_slot_count();
      tree.VisitVisibilitySlots(i, [&](size_t slot) {
        ASSERT_LT(slot, last);
        is_visited[slot] = true;
        last = slot;
      });
      EXPECT_LT(last, LightTree::kWidth);
    }
    for (size_t slot = 0; slot < is_visited.size(); ++slot) {
      EXPECT_EQ(is_visited[slot], tree.HasVisibilitySlot(slot));
    }
  }
}

TEST(LightTreeTest, BrightLightsHaveTheMostSlots) {
  constexpr size_t kCount = 20000;
  std::vector<LightBounds> lights = MakeLights(kCount, 15);
  const auto is_bright = [](const LightBounds& light) {
    return LengthSquared(light.center - Vec3f{5, -5, 5}) < 4;
  };
  for (LightBounds& light : lights) light.strength *= is_bright(light) ? 1000.0f : 1.0f;
  const LightTree tree(lights);
  double sums[2] = {};
  int counts[2] = {};
  for (uint32_t i = 0; i < kCount; ++i) {
    const bool bright = is_bright(lights[i]);
    ++counts[bright];
    tree.VisitVisibilitySlots(i, [&](size_t) { ++sums[bright]; });
  }
  ASSERT_GT(counts[1], 50);
  EXPECT_GT(sums[1] / counts[1], sums[0] / counts[0] + 1);
}

TEST(LightTreeTest, BrighterNearerAndFacingLightsAreLikelier) {
  const auto panel = [](Vec3f center, Vec3f normal, float strength) {
    return LightBounds{.kind = LightBounds::Kind::kPlanar,
                       .two_sided = false,
                       .center = center,
                       .normal = normal,
                       .radius = 0.1f,
                       .area = 0.02f,
                       .strength = strength};
  };
  const LightTree tree({panel({0, 0, 2}, {0, 0, -1}, 1), panel({0, 0, 4}, {0, 0, -1}, 1),
                        panel({0, 0, 4}, {0, 0, -1}, 0.1f), panel({0, 0, 4}, {0.8f, 0, -0.6f}, 1),
                        panel({3, 0, 2.6f}, {-0.7f, 0, -0.7f}, 1), panel({0, 0, 2}, {0, 0, 1}, 1)});
  const auto probability = [&](uint32_t light) { return tree.Probability(light, {}, {0, 0, 1}); };
  EXPECT_GT(probability(0), 3 * probability(1));
  EXPECT_GT(probability(1), 3 * probability(2));
  EXPECT_GT(probability(1), 1.3f * probability(3));
  EXPECT_GT(probability(1), 1.3f * probability(4));
  // The dim light keeps its fraction of kIntensityProbability among the lights that do not face
  // away.
  EXPECT_GT(static_cast<double>(probability(2)), LightTree::kIntensityProbability * 0.1 / 4.1);
  EXPECT_EQ(probability(5), 0);
}

// A far cluster is weighted by the light it really sends, however its normals are spread.
TEST(LightTreeTest, FarClustersUseTheirMeanCosine) {
  enum class Spread { kNone, kHemisphere, kSphere, kNoNormals };
  Random random(21);
  for (Spread spread : {Spread::kNone, Spread::kHemisphere, Spread::kSphere, Spread::kNoNormals}) {
    for (bool two_sided : {false, true}) {
      std::vector<LightBounds> lights(1000);
      for (LightBounds& light : lights) {
        light.kind =
            spread == Spread::kNoNormals ? LightBounds::Kind::kSphere : LightBounds::Kind::kPlanar;
        light.two_sided = two_sided;
        light.center = random.Vector(1);
        light.normal = {0, 0, 1};
        if (spread == Spread::kHemisphere || spread == Spread::kSphere) {
          light.normal = random.Direction();
        }
        if (spread == Spread::kHemisphere) light.normal.z = std::fabs(light.normal.z);
        light.radius = 0.01f;
        light.area = 1e-4f;
        light.strength = random.Between(0.5f, 2);
      }
      const LightTree tree(lights);
      for (const Vec3f& to_p : {Vec3f{0, 0, 1}, Vec3f{0.8f, 0, 0.6f}, Vec3f{0, 0.96f, 0.28f}}) {
        const Vec3f p = to_p * 100;
        double expected = 0;
        for (const LightBounds& light : lights) {
          const Vec3f away = p - light.center;
          const float along = Dot(light.normal, away) / Length(away);
          const float cosine = light.kind == LightBounds::Kind::kSphere ? 1
                               : two_sided                              ? std::fabs(along)
                                                                        : std::max(along, 0.0f);
          expected +=
              static_cast<double>(light.strength * light.area * cosine / LengthSquared(away));
        }
        EXPECT_NEAR(tree.Irradiance(p, {}) / expected, 1, two_sided ? 0.35 : 0.25)
            << static_cast<int>(spread) << " " << two_sided << " " << to_p.z;
      }
    }
  }
}

TEST(LightTreeTest, SingleLightIsCertainAndInvalidOnesAreExcluded) {
  std::vector<LightBounds> lights = MakeLights(40, 4);
  for (size_t i = 0; i < lights.size(); ++i) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const float inf = std::numeric_limits<float>::infinity();
    if (i == 17) continue;
    if (i % 5 == 0) lights[i].strength = 0;
    if (i % 5 == 1) lights[i].center.y = i % 2 == 0 ? nan : 3e38f;
    if (i % 5 == 2) lights[i].radius = lights[i].strength = inf;
    if (i % 5 == 3) lights[i].kind = LightBounds::Kind::kInfinite;
    if (i % 5 == 4) lights[i].strength = nan;
  }
  const LightTree tree(lights);  // Light 17 is a sphere.
  for (const Vec3f& p : {Vec3f{}, Vec3f{50, -3, 8}, lights[17].center}) {
    for (uint32_t i = 0; i < lights.size(); ++i) {
      EXPECT_EQ(tree.Probability(i, p, {}), i == 17 ? 1 : 0);
    }
    for (double u : {0.0, 0.5, 1 - 0x1p-53}) EXPECT_EQ(tree.Choose(p, {}, u)->light, 17u);
  }
  EXPECT_TRUE(LightTree(std::vector<LightBounds>()).empty());
  lights.erase(lights.begin() + 17);
  EXPECT_TRUE(LightTree(lights).empty());
}

TEST(LightTreeTest, ScaleByAPowerOfTwoChangesNoBit) {
  constexpr size_t kCount = 700;
  const LightTree tree(MakeLights(kCount, 5));
  for (float scale : {0x1p-20f, 0x1p-3f, 0x1p20f}) {
    for (float brightness : {1.0f, 0x1p-30f, 0x1p40f}) {
      std::vector<LightBounds> lights = MakeLights(kCount, 5, scale);
      for (LightBounds& light : lights) light.strength *= brightness;
      const LightTree scaled(lights);
      Random random(9);
      for (int i = 0; i < 40; ++i) {
        const Vec3f p = random.Vector(12), n = i % 2 == 0 ? Vec3f{} : random.Direction();
        const double u = static_cast<double>(random.Between(0, 1));
        const auto a = tree.Choose(p, n, u), b = scaled.Choose(p * scale, n, u);
        ASSERT_TRUE(a && b);
        ASSERT_EQ(a->light, b->light);
        ASSERT_EQ(a->probability, b->probability);
        ASSERT_EQ(tree.Irradiance(p, n) * static_cast<double>(brightness),
                  scaled.Irradiance(p * scale, n));
        const std::vector<uint8_t> steps =
            RandomSteps(tree.visibility_slot_count(), static_cast<uint64_t>(i));
        const LightVisibilityRow row{steps.data()};
        const auto c = tree.Choose(p, n, u, row), d = scaled.Choose(p * scale, n, u, row);
        ASSERT_TRUE(c && d);
        ASSERT_EQ(c->light, d->light);
        ASSERT_EQ(c->probability, d->probability);
        ASSERT_EQ(tree.Irradiance(p, n, row) * static_cast<double>(brightness),
                  scaled.Irradiance(p * scale, n, row));
      }
    }
  }
}

TEST(LightTreeTest, NothingArrivesFromBelowTheHorizonOrOutsideTheCone) {
  std::vector<LightBounds> spots(100);
  Random random(10);
  for (LightBounds& spot : spots) {
    spot = {.kind = LightBounds::Kind::kPoint,
            .center = Vec3f{0, 0, 10} + random.Vector(1),
            .normal = Normalize(Vec3f{0, 0, -1} + random.Vector(0.1f)),
            .strength = 1,
            .cos_end = 0.9f};  // 26 degrees.
  }
  const LightTree tree(spots);
  EXPECT_GT(tree.Irradiance({}, {}), 0);
  EXPECT_GT(tree.Irradiance({2, 2, 0}, {0, 0, 1}), 0);
  EXPECT_GT(tree.Irradiance({0, 0, 10}, {0, 0, 1}), 0);
  EXPECT_EQ(tree.Irradiance({}, {0, 0, -1}), 0);
  EXPECT_EQ(tree.Irradiance({20, 0, 0}, {}), 0);
  EXPECT_EQ(tree.Irradiance({0, 0, 20}, {}), 0);
  EXPECT_FALSE(tree.Choose({20, 0, 0}, {}, 0.3).has_value());
  EXPECT_EQ(tree.Probability(3, {20, 0, 0}, {}), 0);
}

TEST(LightTreeTest, NonFiniteReceiversGiveFiniteNumbers) {
  const LightTree tree(MakeLights(500, 11));
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  for (const Vec3f& p : {Vec3f{nan, 0, 0}, Vec3f{0, inf, 0}, Vec3f{-inf, nan, inf},
                         Vec3f{3e38f, 3e38f, -3e38f}, Vec3f{1e-40f, 0, 0}}) {
    for (const Vec3f& n : {Vec3f{}, Vec3f{0, 0, 1}, Vec3f{nan, nan, nan}}) {
      const auto chosen = tree.Choose(p, n, 0.7);
      if (!chosen) continue;
      EXPECT_TRUE(chosen->probability > 0 && chosen->probability <= 1);
    }
  }
}

}  // namespace
}  // namespace sheaf::render
