// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LobeSketch against closed forms and quadratures, and the choice of lights by it: its agreement
// with its probabilities, and its invariances.
#include "worker/render/light/choice/lobe_sketch.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "common/math/elementary.h"
#include "tests/support/random_lights.h"
#include "worker/render/light/choice/light_choice.h"

namespace sheaf::render {
namespace {

constexpr Vec3f kUp{0, 0, 1};

// The direction at an angle from the normal, on the side of -x for wo and of +x for its mirror.
Vec3f AtAngle(double angle) {
  return {static_cast<float>(Sin(angle)), 0, static_cast<float>(Cos(angle))};
}

double LobeAt(const LobeSketch& sketch, Vec3f to, double variance = 0) {
  const Lanes lobe = sketch.LobeAt(All(to.x), All(to.y), All(to.z), All(1 / Length(to)),
                                   All(static_cast<float>(variance)));
  for (size_t i = 1; i < kLaneCount; ++i) EXPECT_EQ(lobe[i], lobe[0]);
  return static_cast<double>(lobe[0]);
}

// Calls add(direction, solid angle) for parts of the sphere above the horizon.
template <typename AddPart>
void ForHemisphere(int count, const AddPart& add) {
  for (int i = 0; i < count; ++i) {
    const double z = (i + 0.5) / count, radius = std::sqrt(1 - z * z);
    for (int j = 0; j < 2 * count; ++j) {
      const double angle = kPi * (j + 0.5) / count;
      add(Vec3f{static_cast<float>(radius * Cos(angle)), static_cast<float>(radius * Sin(angle)),
                static_cast<float>(z)},
          2 * kPi / (2.0 * count * count));
    }
  }
}

// With visible normals a lobe reflects all light: the integral of G1(wo) D(h) / (4 cos(wo)) over
// directions is 1 but for those below the horizon.
TEST(LobeSketchTest, TheLobeIntegratesToWhatItReflects) {
  for (const float alpha : {0.1f, 0.15f}) {
    for (const double angle : {0.0, 0.5, 0.9}) {
      for (const float diffuse : {0.0f, 0.4f}) {
        const LobeSketch sketch = LobeSketch::Make(AtAngle(-angle), kUp, alpha, diffuse, 0.5f);
        const double counted = std::fmax(diffuse, 0.1 * (diffuse + 0.5));
        double sum = 0;
        ForHemisphere(400, [&](Vec3f w, double part) { sum += part * LobeAt(sketch, w) / kPi; });
        EXPECT_NEAR(sum * counted, 0.5, 0.5 * 0.06) << alpha << " " << angle << " " << diffuse;
        EXPECT_NEAR(static_cast<double>(sketch.OfAllDirections()), 1 + 0.5 / counted, 1e-4);
      }
    }
  }
}

// The lobe of a single direction is that of GGX: D G1 F / (4 cos), over the diffuse part.
TEST(LobeSketchTest, OneDirectionHasTheLobeOfGgx) {
  Random random(3);
  for (int i = 0; i < 1000; ++i) {
    Vec3f wo = random.Direction(), wi = random.Direction();
    wo.z = std::fabs(wo.z) + 0.01f;
    wi.z = std::fabs(wi.z);
    wo = Normalize(wo);
    wi = Normalize(wi);
    const float alpha = random.Between(0.05f, 1);
    const LobeSketch sketch = LobeSketch::Make(wo, kUp, alpha, 0.3f, 0.2f);
    const Vec3d h = Normalize(ToDouble(wo) + ToDouble(wi));
    const double a2 = static_cast<double>(alpha) * static_cast<double>(alpha),
                 falloff = 1 - h.z * h.z * (1 - a2), d = a2 / (kPi * falloff * falloff),
                 cos_o = static_cast<double>(wo.z),
                 g1 = 2 * cos_o / (cos_o + std::sqrt(a2 + (1 - a2) * cos_o * cos_o)),
                 expected = 0.2 * d * g1 / (4 * cos_o) / (0.3 / kPi);
    EXPECT_NEAR(LobeAt(sketch, wi * 7), expected, 2e-3 * expected);
  }
}

// The mean of the lobe over directions about one, which spread like a cube of lights there.
TEST(LobeSketchTest, SpreadLightsGetTheMeanOfTheLobe) {
  for (const float alpha : {0.1f, 0.3f}) {
    for (const double angle : {0.2, 0.8}) {
      for (const float half : {0.03f, 0.1f, 0.3f}) {
        for (const double off : {0.0, 0.15}) {
          const LobeSketch sketch = LobeSketch::Make(AtAngle(-angle), kUp, alpha, 0.3f, 0.2f);
          const Vec3f center = AtAngle(angle + off);
          constexpr int kCount = 24;
          double mean = 0;
          for (int k = 0; k < kCount * kCount * kCount; ++k) {
            const auto at = [&](int index) {
              return half * (2 * (static_cast<float>(index % kCount) + 0.5f) / kCount - 1);
            };
            const Vec3f to = center + Vec3f{at(k), at(k / kCount), at(k / kCount / kCount)};
            mean += LobeAt(sketch, to) / (kCount * kCount * kCount);
          }
          const double h = static_cast<double>(half), estimate = LobeAt(sketch, center, h * h / 3);
          // The shape of the widened lobe is not that of the mean.
          EXPECT_LT(std::fabs(std::log(estimate / mean)), std::log(1.6))
              << alpha << " " << angle << " " << half << " " << off;
        }
      }
    }
  }
}

// A sketch at p, with a normal for the choice.
struct At {
  Vec3f p, n;
  LobeSketch sketch;
};
At RandomPlace(Random* random, bool has_normal) {
  At at;
  at.p = random->Vector(10);
  const Vec3f n = random->Direction();
  Vec3f wo = random->Direction();
  if (Dot(wo, n) < 0) wo = -wo;
  at.n = has_normal ? n : Vec3f{};
  at.sketch = LobeSketch::Make(wo, n, random->Between(0.02f, 0.6f), random->Between(0, 0.5f),
                               random->Between(0.05f, 1));
  return at;
}

std::vector<LightBounds> WithSky(std::vector<LightBounds> lights) {
  lights[lights.size() / 2] = {.kind = LightBounds::Kind::kInfinite, .strength = 0.5f};
  return lights;
}

// The statistic of a chi-square test with `bins` expected counts of at least 5 each.
TEST(LobeSketchTest, ChoicesHaveTheirProbabilities) {
  constexpr int kDraws = 1 << 14;
  for (const size_t count : {2u, 9u, 16u, 17u, 300u, 3000u}) {
    const LightChoice choice(count == 9 || count == 300 ? WithSky(render::MakeLights(count, count))
                                                        : render::MakeLights(count, count));
    Random random(count);
    for (uint64_t k = 0; k < 8; ++k) {
      const At at = RandomPlace(&random, k % 2 == 0);
      const std::vector<uint8_t> steps = RandomSteps(choice.visibility_slot_count(), k);
      const ProductRow row{{k % 4 < 2 ? nullptr : steps.data()}, &at.sketch};
      std::vector<int> counts(count);
      int chosen_count = 0;
      for (int i = 0; i < kDraws; ++i) {
        const float u = (static_cast<float>(i) + 0.5f) / kDraws;
        const auto chosen = choice.Choose(at.p, at.n, u, static_cast<uint64_t>(i) << 40, row);
        if (!chosen) continue;
        ASSERT_EQ(chosen->probability, choice.Probability(chosen->light, at.p, at.n, row));
        ++counts[chosen->light];
        ++chosen_count;
      }
      double sum = 0, chi_square = 0, rest = 0, rest_counted = 0;
      int bins = 0;
      for (uint32_t i = 0; i < count; ++i) {
        const auto p = static_cast<double>(choice.Probability(i, at.p, at.n, row));
        sum += p;
        // p > 0 wherever the light may shine.
        EXPECT_EQ(p > 0, choice.Probability(i, at.p, at.n) > 0);
        if (p * kDraws < 5) {
          rest += p * kDraws;
          rest_counted += counts[i];
          continue;
        }
        chi_square += (counts[i] - p * kDraws) * (counts[i] - p * kDraws) / (p * kDraws);
        ++bins;
      }
      if (rest >= 5) {
        chi_square += (rest_counted - rest) * (rest_counted - rest) / rest;
        ++bins;
      }
      EXPECT_NEAR(sum, chosen_count > 0 ? 1 : 0, 1e-4);
      // Stratified draws stay far below the 99.99th percentile of independent ones.
      EXPECT_LT(chi_square, bins + 4 * std::sqrt(2.0 * bins) + 4) << count << " " << k;
    }
  }
}

TEST(LobeSketchTest, NoSketchChangesNoBit) {
  for (const size_t count : {5u, 16u, 400u}) {
    const LightChoice choice(WithSky(render::MakeLights(count, 12)));
    const std::vector<uint8_t> steps = RandomSteps(choice.visibility_slot_count(), 3);
    Random random(13);
    for (int i = 0; i < 100; ++i) {
      const At at = RandomPlace(&random, i % 2 == 0);
      const LightVisibilityRow row{i % 3 == 0 ? nullptr : steps.data()};
      const float u = random.Between(0, 1);
      const auto a = choice.Choose(at.p, at.n, u, 0, row),
                 b = choice.Choose(at.p, at.n, u, 0, ProductRow{row, nullptr});
      ASSERT_EQ(a.has_value(), b.has_value());
      if (!a) continue;
      EXPECT_EQ(a->light, b->light);
      EXPECT_EQ(a->probability, b->probability);
      EXPECT_EQ(choice.Probability(a->light, at.p, at.n, ProductRow{row, nullptr}), a->probability);
    }
  }
}

TEST(LobeSketchTest, ScaleByAPowerOfTwoChangesNoBitOfChoices) {
  for (const size_t count : {16u, 700u}) {
    const LightChoice choice(render::MakeLights(count, 5));
    for (const float scale : {0x1p-20f, 0x1p20f}) {
      for (const float brightness : {1.0f, 0x1p-20f, 0x1p20f}) {
        std::vector<LightBounds> lights = render::MakeLights(count, 5, scale);
        for (LightBounds& light : lights) light.strength *= brightness;
        const LightChoice scaled(lights);
        Random random(9);
        for (int i = 0; i < 100; ++i) {
          const At at = RandomPlace(&random, i % 2 == 0);
          const ProductRow row{{}, &at.sketch};
          const float u = random.Between(0, 1);
          const auto a = choice.Choose(at.p, at.n, u, 0, row),
                     b = scaled.Choose(at.p * scale, at.n, u, 0, row);
          ASSERT_EQ(a.has_value(), b.has_value());
          if (!a) continue;
          ASSERT_EQ(a->light, b->light);
          ASSERT_EQ(a->probability, b->probability);
        }
      }
    }
  }
}

// Ahead of a glossy floor, the lamp in the mirror direction is chosen far more often than by its
// irradiance, and no other lamp much less often than a tenth of the diffuse part leaves it.
TEST(LobeSketchTest, TheLampInTheMirrorIsPreferred) {
  std::vector<LightBounds> lights;
  for (int i = 0; i < 400; ++i) {
    lights.push_back({.kind = LightBounds::Kind::kSphere,
                      .center = {static_cast<float>(i % 20), static_cast<float>(i / 20), 2},
                      .radius = 0.05f,
                      .area = 0.0025f * static_cast<float>(kPi),
                      .strength = 1});
  }
  const LightChoice choice(lights);
  const Vec3f p{5, 10, 0};
  const uint32_t ahead = 10 * 20 + 9;
  const LobeSketch sketch = LobeSketch::Make(Normalize(Vec3f{-4, 0, 2}), kUp, 0.1f, 0.05f, 0.8f);
  const ProductRow row{{}, &sketch};
  EXPECT_GT(choice.Probability(ahead, p, kUp, row), 10 * choice.Probability(ahead, p, kUp));
  const auto behind = static_cast<double>(choice.Probability(10 * 20 + 1, p, kUp, row));
  EXPECT_GT(behind, 0.001 * static_cast<double>(choice.Probability(10 * 20 + 1, p, kUp)));
}

}  // namespace
}  // namespace sheaf::render
