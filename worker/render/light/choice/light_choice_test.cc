// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light/choice/light_choice.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace sheaf::render {
namespace {

LightBounds SphereAt(Vec3f center, float radius, float strength) {
  return {.kind = LightBounds::Kind::kSphere,
          .center = center,
          .radius = radius,
          .area = 3.14159274f * radius * radius,
          .strength = strength};
}
LightBounds PanelAt(Vec3f center, Vec3f normal, float area, bool two_sided) {
  return {.kind = LightBounds::Kind::kPlanar,
          .two_sided = two_sided,
          .center = center,
          .normal = normal,
          .radius = std::sqrt(area),
          .area = area,
          .strength = 1};
}

// Checks that Choose returns every light as often as Probability says, and with the same bits.
template <typename Row = NoLightVisibilityRow>
void ExpectChoiceMatchesProbability(const LightChoice& choice, size_t light_count, Vec3f p,
                                    Vec3f n = {}, Row row = {}) {
  constexpr int kDraws = 1 << 16;
  std::vector<int> counts(light_count);
  for (int i = 0; i < kDraws; ++i) {
    const auto chosen = choice.Choose(p, n, (static_cast<float>(i) + 0.5f) / kDraws, 0, row);
    ASSERT_TRUE(chosen.has_value());
    ASSERT_EQ(chosen->probability, choice.Probability(chosen->light, p, n, row));
    ++counts[chosen->light];
  }
  double sum = 0;
  for (size_t i = 0; i < light_count; ++i) {
    const double probability =
        static_cast<double>(choice.Probability(static_cast<uint32_t>(i), p, n, row));
    EXPECT_NEAR(counts[i], probability * kDraws, 3);
    sum += probability;
  }
  EXPECT_NEAR(sum, 1, 1e-6);
}

TEST(LightChoiceTest, FrequenciesMatchProbabilities) {
  for (size_t count : {1u, 2u, 5u, 16u, 17u, 100u}) {
    std::vector<LightBounds> lights;
    for (size_t i = 0; i < count; ++i) {
      lights.push_back(
          SphereAt({static_cast<float>(i), 1, 2}, 0.3f, 1 + static_cast<float>(i % 3)));
    }
    const LightChoice choice(lights);
    ExpectChoiceMatchesProbability(choice, count, {3, 0, 0});
  }
}

TEST(LightChoiceTest, BrighterAndNearerLightsAreLikelier) {
  const LightChoice choice({SphereAt({0, 0, 1}, 0.1f, 100), SphereAt({0, 0, 10}, 0.1f, 100),
                            SphereAt({0, 0, 10}, 0.1f, 1e-6f)});
  const float near = choice.Probability(0, {}, {}), far = choice.Probability(1, {}, {}),
              dim = choice.Probability(2, {}, {});
  EXPECT_GT(near, 0.75f);
  EXPECT_GT(near, far);
  EXPECT_GT(far, dim);
  EXPECT_GT(dim, 0.08f);
}

TEST(LightChoiceTest, PanelsFacingAwayAreExcluded) {
  const LightChoice choice({PanelAt({0, 0, 1}, {0, 0, 1}, 1, false),
                            PanelAt({0, 0, 2}, {0, 0, -1}, 1, false),
                            PanelAt({0, 0, 3}, {0, 0, 1}, 1, true)});
  EXPECT_EQ(choice.Probability(0, {}, {}), 0);
  EXPECT_GT(choice.Probability(1, {}, {}), 0);
  EXPECT_GT(choice.Probability(2, {}, {}), 0);
  ExpectChoiceMatchesProbability(choice, 3, {});
  // All lights face away: there is nothing to choose.
  const LightChoice none(
      {PanelAt({0, 0, 1}, {0, 0, 1}, 1, false), PanelAt({0, 0, 2}, {0, 0, 1}, 1, false)});
  EXPECT_FALSE(none.Choose({}, {}, 0.5f, 0).has_value());
}

TEST(LightChoiceTest, LightsBehindTheReceiverAreExcluded) {
  // Behind, in front, across the horizon, and a spot that points elsewhere.
  const LightChoice choice({SphereAt({0, 0, -2}, 1, 1),
                            SphereAt({0, 0, 2}, 1, 1),
                            SphereAt({3, 0, -0.5f}, 1, 1),
                            {.kind = LightBounds::Kind::kPoint,
                             .center = {0, 0, 1},
                             .normal = {0, 0, 1},
                             .strength = 1,
                             .cos_end = 0.5f}});
  const Vec3f up{0, 0, 1};
  EXPECT_EQ(choice.Probability(0, {}, up), 0);
  EXPECT_GT(choice.Probability(1, {}, up), choice.Probability(2, {}, up));
  EXPECT_GT(choice.Probability(2, {}, up), 0);
  EXPECT_EQ(choice.Probability(3, {}, up), 0);
  EXPECT_GT(choice.Probability(3, {0, 0.5f, 3}, {}), 0);
  EXPECT_EQ(choice.Probability(0, {}, {}), choice.Probability(1, {}, {}));
  ExpectChoiceMatchesProbability(choice, 4, {}, up);
}

TEST(LightChoiceTest, InfiniteLightsKeepProbabilityAmongMany) {
  std::vector<LightBounds> lights;
  for (int i = 0; i < 50; ++i) lights.push_back(SphereAt({static_cast<float>(i), 0, 2}, 0.1f, 5));
  lights.push_back({.kind = LightBounds::Kind::kInfinite, .strength = 3e-3f});
  lights.push_back({.kind = LightBounds::Kind::kInfinite, .strength = 0});
  lights.push_back({.kind = LightBounds::Kind::kInfinite, .strength = 1e-3f});
  const LightChoice choice(lights);
  const auto infinite_probability = [&](Vec3f p, Vec3f n) {
    EXPECT_EQ(choice.Probability(51, p, n), 0);
    EXPECT_NEAR(choice.Probability(50, p, n), 3 * choice.Probability(52, p, n), 1e-6);
    return choice.Probability(50, p, n) + choice.Probability(52, p, n);
  };
  // Near the local lights, far from them, and where they are behind the receiver.
  EXPECT_NEAR(infinite_probability({20, 0, 1.8f}, {}), 0.1, 1e-6);
  EXPECT_NEAR(infinite_probability({20, 0, 1e4f}, {}), 0.9, 1e-6);
  EXPECT_EQ(infinite_probability({20, 0, 0}, {0, 0, -1}), 1);
  for (const Vec3f& p : {Vec3f{20, 0, 1.8f}, Vec3f{20, 0, 30}, Vec3f{20, 0, 1e4f}}) {
    ExpectChoiceMatchesProbability(choice, lights.size(), p);
    ExpectChoiceMatchesProbability(choice, lights.size(), p, {0, 0.6f, -0.8f});
  }
}

// Spheres, panels and an infinite light.
std::vector<LightBounds> MixedLights(size_t count) {
  std::vector<LightBounds> lights;
  for (size_t i = 0; i < count; ++i) {
    const auto x = static_cast<float>(i % 11);
    const Vec3f center{x, static_cast<float>(i / 11), 2 + 0.3f * x};
    lights.push_back(i % 3 == 0 ? PanelAt(center, {0, 0, -1}, 0.2f, i % 2 == 0)
                                : SphereAt(center, 0.3f, 1 + static_cast<float>(i % 4)));
  }
  lights[count / 2] = {.kind = LightBounds::Kind::kInfinite, .strength = 0.4f};
  return lights;
}

std::vector<uint8_t> DrawSteps(size_t count) {
  std::mt19937 engine(3);
  std::vector<uint8_t> steps;
  while (steps.size() < count) {
    steps.push_back(static_cast<uint8_t>(std::max<uint32_t>(engine() % 256, kVisibilityStepMin)));
  }
  return steps;
}

TEST(LightChoiceTest, LearnedChoicesMatchTheirProbabilities) {
  for (size_t count : {2u, 5u, 16u, 17u, 100u}) {
    const LightChoice choice(MixedLights(count));
    const std::vector<uint8_t> steps = DrawSteps(choice.visibility_slot_count());
    const LightVisibilityRow row{steps.data()};
    for (const Vec3f& n : {Vec3f{}, Vec3f{0, 0, 1}, Vec3f{0, 0.6f, -0.8f}}) {
      const Vec3f p{3, 0.5f, 0};
      ExpectChoiceMatchesProbability(choice, count, p, n, row);
      // A light that the row makes unlikely keeps a part of its probability, and none gets one.
      for (uint32_t i = 0; i < count; ++i) {
        const float without = choice.Probability(i, p, n), with = choice.Probability(i, p, n, row);
        EXPECT_EQ(with > 0, without > 0);
        EXPECT_GE(with, without / 4096);
      }
    }
  }
}

TEST(LightChoiceTest, RowsThatKnowNothingChangeNoBit) {
  for (size_t count : {1u, 2u, 16u, 17u, 300u}) {
    const LightChoice choice(MixedLights(count));
    const std::vector<uint8_t> ones(choice.visibility_slot_count(), kVisibilityStepOfOne);
    for (const LightVisibilityRow& row : {LightVisibilityRow{}, LightVisibilityRow{ones.data()}}) {
      for (int i = 0; i < 256; ++i) {
        const Vec3f p{static_cast<float>(i % 16), static_cast<float>(i % 7), 0.01f},
            n = i % 2 == 0 ? Vec3f{} : Vec3f{0, 0.6f, 0.8f};
        const float u = (static_cast<float>(i) + 0.5f) / 256;
        const auto without = choice.Choose(p, n, u, 77), with = choice.Choose(p, n, u, 77, row);
        ASSERT_TRUE(without && with);
        ASSERT_EQ(without->light, with->light);
        ASSERT_EQ(without->probability, with->probability);
        const auto light = static_cast<uint32_t>(static_cast<size_t>(i) % count);
        ASSERT_EQ(choice.Probability(light, p, n), choice.Probability(light, p, n, row));
      }
    }
  }
}

TEST(LightChoiceTest, ScaleByAPowerOfTwoChangesNoBit) {
  for (float scale : {0x1p-20f, 0x1p-3f, 0x1p20f}) {
    const auto scaled = [](float s) {
      LightBounds panel = PanelAt(Vec3f{1, 2, 3} * s, {0.6f, 0, -0.8f}, 0.7f * s * s, true);
      panel.radius = 0.9f * s;
      return LightChoice({SphereAt(Vec3f{-1, 0, 2} * s, 0.3f * s, 2), panel,
                          SphereAt(Vec3f{4, 4, 4} * s, 1.5f * s, 0.1f)});
    };
    const Vec3f p{0.3f, -0.2f, 0.1f};
    for (uint32_t light = 0; light < 3; ++light) {
      EXPECT_EQ(scaled(1).Probability(light, p, {}),
                scaled(scale).Probability(light, p * scale, {}));
      const std::vector<uint8_t> steps = DrawSteps(kLaneCount);
      const LightVisibilityRow row{steps.data()};
      EXPECT_EQ(scaled(1).Probability(light, p, {}, row),
                scaled(scale).Probability(light, p * scale, {}, row));
    }
  }
}

}  // namespace
}  // namespace sheaf::render
