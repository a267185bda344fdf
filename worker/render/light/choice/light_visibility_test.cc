// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightVisibility from tries to choices, and its bytes.
#include "worker/render/light/choice/light_visibility.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "common/base/check.h"
#include "common/base/parallel.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "worker/render/light/light_table.h"

namespace sheaf::render {
namespace {

using ::testing::HasSubstr;

constexpr Vec3f kReceiver{0, 0, -20};

// Spheres of equal strength about the origin: even lights on the left, odd ones on the right. The
// last infinite_count lights are infinite.
std::vector<LightBounds> MakeLights(size_t count, size_t infinite_count = 0) {
  std::mt19937_64 engine(count);
  const auto between = [&](float low, float high) {
    return low + (high - low) * static_cast<float>(engine() >> 40) * 0x1p-24f;
  };
  std::vector<LightBounds> lights;
  for (size_t i = 0; i < count; ++i) {
    const float side = i % 2 == 0 ? -1 : 1, y = between(-5, 5);
    lights.push_back({.kind = LightBounds::Kind::kSphere,
                      .center = {side * between(1, 6), y, between(-1, 1)},
                      .radius = 0.1f,
                      .area = 0.0314f,
                      .strength = between(0.9f, 1.1f)});
    if (i + infinite_count < count) continue;
    lights.back() = {.kind = LightBounds::Kind::kInfinite, .strength = 1e-3f};
  }
  return lights;
}

float SumOfEven(const LightChoice& choice, size_t count, LightVisibilityRow row) {
  float sum = 0;
  for (uint32_t i = 0; i < count; i += 2) sum += choice.Probability(i, kReceiver, {}, row);
  return sum;
}

TEST(LightVisibilityTest, HiddenHalfOfTheLightsIsRarelyChosen) {
  for (size_t count : {2u, 10u, 16u, 17u, 100u, 5000u}) {
    const LightChoice choice(MakeLights(count));
    EXPECT_NEAR(SumOfEven(choice, count, {}), 0.5, 0.1) << count;
    LightVisibilityStatistics statistics(choice, 2);
    for (int i = 0; i < 1000; ++i) {
      const float u = (static_cast<float>(i) + 0.5f) / 1000;
      const auto chosen = choice.Choose(kReceiver, {}, u, 0);
      ASSERT_TRUE(chosen.has_value());
      statistics.Add(1, chosen->light, chosen->light % 2 != 0);
    }
    const LightVisibility visibility = statistics.Freeze();
    EXPECT_LT(SumOfEven(choice, count, visibility.RowOf(1)), 0.25f) << count;
    // Nothing was tried in the other region.
    for (uint32_t i = 0; i < count; ++i) {
      ASSERT_EQ(choice.Probability(i, kReceiver, {}, visibility.RowOf(0)),
                choice.Probability(i, kReceiver, {}));
      ASSERT_GT(choice.Probability(i, kReceiver, {}, visibility.RowOf(1)), 0);
    }
  }
}

TEST(LightVisibilityTest, FactorsFollowTheTriesAndKeepTheirFloor) {
  const LightChoice choice(MakeLights(4));
  LightVisibilityStatistics statistics(choice, 1);
  for (int i = 0; i < 98; ++i) statistics.Add(0, 0, i % 2 == 0);  // (49 + 2) / (98 + 2).
  for (int i = 0; i < 2; ++i) statistics.Add(0, 1, false);        // 2 / 4.
  for (int i = 0; i < 100000; ++i) statistics.Add(0, 2, false);
  const LightVisibility visibility = statistics.Freeze();
  const LightVisibilityRow row = visibility.RowOf(0);
  EXPECT_NEAR(VisibilityFactor(row, 0), 0.51, 0.5 / kVisibilitySteps);
  EXPECT_EQ(VisibilityFactor(row, 1), 0.5f);
  EXPECT_EQ(VisibilityFactor(row, 2), 1 / 16.0f);
  EXPECT_EQ(VisibilityFactor(row, 3), 1);
  const Lanes factors = VisibilityFactors(row, 0);
  for (size_t i = 0; i < kLaneCount; ++i) EXPECT_EQ(factors[i], VisibilityFactor(row, i));
}

TEST(LightVisibilityTest, InfiniteLightsAmongManyAreLearnedTogether) {
  constexpr size_t kCount = 40;
  const LightChoice choice(MakeLights(kCount, 2));
  const auto infinite = [&](LightVisibilityRow row) {
    return choice.Probability(kCount - 2, kReceiver, {}, row) +
           choice.Probability(kCount - 1, kReceiver, {}, row);
  };
  LightVisibilityStatistics statistics(choice, 2);
  for (int i = 0; i < 500; ++i) {
    statistics.Add(0, kCount - 1, false);
    statistics.Add(1, kCount - 1, true);
    for (uint32_t local = 0; local < kCount - 2; ++local) statistics.Add(1, local, false);
  }
  const LightVisibility visibility = statistics.Freeze();
  EXPECT_LT(infinite(visibility.RowOf(0)), 0.5f * infinite({}));
  EXPECT_GT(infinite(visibility.RowOf(1)), 1.5f * infinite({}));
}

TEST(LightVisibilityTest, OrderAndThreadsChangeNoByte) {
  for (size_t count : {7u, 3000u}) {
    const LightChoice choice(MakeLights(count, 1));
    struct Try {
      uint32_t region, light;
      bool visible;
    };
    std::vector<Try> tries;
    std::mt19937_64 engine(5);
    for (int i = 0; i < 20000; ++i) {
      const uint64_t bits = engine();
      tries.push_back({static_cast<uint32_t>(bits % 13), static_cast<uint32_t>((bits >> 8) % count),
                       (bits >> 40) % 3 == 0});
    }
    const auto bytes_of = [&](int thread_count) {
      LightVisibilityStatistics statistics(choice, 13);
      ParallelRanges(tries.size(), 16, thread_count, [&](uint64_t begin, uint64_t end) {
        for (uint64_t i = begin; i < end; ++i) {
          statistics.Add(tries[i].region, tries[i].light, tries[i].visible);
        }
      });
      return statistics.Freeze().Encode();
    };
    const std::string bytes = bytes_of(1);
    EXPECT_EQ(bytes.size(), kLightVisibilityHeaderBytes + 13 * choice.visibility_slot_count());
    EXPECT_EQ(bytes_of(4), bytes);
    std::shuffle(tries.begin(), tries.end(), engine);
    EXPECT_EQ(bytes_of(3), bytes);
    tries.pop_back();
    tries.push_back({3, 2, false});
    tries.insert(tries.end(), 10, tries.back());
    EXPECT_NE(bytes_of(1), bytes);
  }
}

TEST(LightVisibilityTest, NothingToChooseHasNoRows) {
  for (size_t count : {0u, 1u}) {
    const LightChoice choice(MakeLights(count));
    LightVisibilityStatistics statistics(choice, 5);
    if (count == 1) statistics.Add(4, 0, false);
    const LightVisibility visibility = statistics.Freeze();
    EXPECT_EQ(visibility.RowOf(4).steps, nullptr);
    const auto decoded = LightVisibility::Decode(visibility.Encode(), choice);
    ASSERT_TRUE(decoded.ok());
    EXPECT_EQ(decoded->Encode(), visibility.Encode());
  }
  const LightChoice choice(MakeLights(20));
  const LightVisibility visibility = LightVisibilityStatistics(choice, 5).Freeze();
  EXPECT_NE(visibility.RowOf(4).steps, nullptr);
  EXPECT_EQ(visibility.RowOf(5).steps, nullptr);
  EXPECT_EQ(visibility.RowOf(~0u).steps, nullptr);
}

std::string SomeBytes(const LightChoice& choice, uint32_t light_count) {
  LightVisibilityStatistics statistics(choice, 3);
  for (uint32_t i = 0; i < 400; ++i) statistics.Add(i % 3, i % light_count, i % 5 == 0);
  return statistics.Freeze().Encode();
}

TEST(LightVisibilityTest, BytesComeBackWhole) {
  for (uint32_t count : {2u, 9u, 16u, 17u, 2000u}) {
    const LightChoice choice(MakeLights(count, 1));
    const std::string bytes = SomeBytes(choice, count);
    EXPECT_LE(bytes.size(), kLightVisibilityBytesMax);
    const auto decoded = LightVisibility::Decode(bytes, choice);
    ASSERT_TRUE(decoded.ok()) << decoded.status();
    EXPECT_EQ(decoded->region_count(), 3u);
    EXPECT_EQ(decoded->Encode(), bytes);
    for (uint32_t region = 0; region < 3; ++region) {
      float least = 1;
      for (size_t slot = 0; slot < choice.visibility_slot_count(); ++slot) {
        least = std::min(least, VisibilityFactor(decoded->RowOf(region), slot));
      }
      EXPECT_LT(least, 0.5f);
    }
  }
}

TEST(LightVisibilityTest, OtherBytesAreRefused) {
  for (uint32_t count : {9u, 20u}) {
    const LightChoice choice(MakeLights(count));
    const std::string bytes = SomeBytes(choice, count);
    const auto expect_refused = [&](const std::string& wrong, const std::string& why) {
      const auto decoded = LightVisibility::Decode(wrong, choice);
      ASSERT_FALSE(decoded.ok()) << why;
      EXPECT_EQ(decoded.status().code(), absl::StatusCode::kDataLoss);
      EXPECT_THAT(decoded.status().message(), HasSubstr(why));
    };
    for (size_t size = 0; size < bytes.size(); ++size) expect_refused(bytes.substr(0, size), "");
    expect_refused(bytes + '\xff', "factors, not 3 times");
    // Any other byte is refused, or is another factor that Encode could have written.
    size_t accepted = 0;
    for (size_t at = 0; at < bytes.size(); ++at) {
      for (int flip = 1; flip < 256; ++flip) {
        std::string wrong = bytes;
        wrong[at] = static_cast<char>(wrong[at] ^ flip);
        const auto decoded = LightVisibility::Decode(wrong, choice);
        if (!decoded.ok()) continue;
        ASSERT_GE(at, kLightVisibilityHeaderBytes);
        ASSERT_EQ(decoded->Encode(), wrong);
        ASSERT_GE(static_cast<uint8_t>(wrong[at]), kVisibilityStepMin);
        ++accepted;
      }
    }
    EXPECT_GT(accepted, 0u);
    std::string low = bytes;
    low[kLightVisibilityHeaderBytes] = static_cast<char>(kVisibilityStepMin - 1);
    expect_refused(low, "has the factor 15 / 256 where at least 16 / 256");
    // A place without a light: the last lane, or the infinite lights.
    std::string empty_place = bytes;
    empty_place.back() = static_cast<char>(kVisibilityStepOfOne - 1);
    expect_refused(empty_place, "has the factor 255 / 256 where at least 256 / 256");
    expect_refused(SomeBytes(LightChoice(MakeLights(3000)), 3000), "the scene has");
    expect_refused(std::string("SLV1\xff\xff\xff\xff\xff\xff\xff\xff", 12),
                   "regions, not 1 to 8192");
    expect_refused(std::string("SLV1\x01\x00\x00\x00\x00\x00\x00\x00", 12), "the scene has");
    std::mt19937_64 engine(count);
    for (int i = 0; i < 2000; ++i) {
      std::string garbage = i % 2 == 0 ? "SLV1" : "";
      for (uint64_t size = engine() % 200; size > 0; --size) {
        garbage.push_back(static_cast<char>(engine()));
      }
      expect_refused(garbage, "");
    }
  }
}

// Triangles on both sides of the receiver, a point light and a sky.
std::unique_ptr<LightTable> MakeTable(uint32_t triangle_count) {
  LightTableInput input;
  for (uint32_t i = 0; i < triangle_count; ++i) {
    const float side = i % 2 == 0 ? -1 : 1;
    const Vec3f at{side * static_cast<float>(1 + i / 2), static_cast<float>(i % 5), 3};
    input.triangles.push_back(
        {at, at + Vec3f{0.3f, 0, 0.1f}, at + Vec3f{0, 0.4f, 0}, Rgb{1, 1, 1}, true});
  }
  SceneDescription scene;
  PointLight point;
  point.intensity.rgb = {1, 1, 1};
  point.from = {0, 2, 4};
  InfiniteLight sky;
  sky.radiance.rgb = {0.05f, 0.05f, 0.05f};
  scene.lights.resize(2);
  scene.lights[0].light = point;
  scene.lights[1].light = sky;
  TableFileSource files({});
  auto table = LightTable::Build(scene, std::move(input), files);
  SHEAF_CHECK(table.ok());
  return std::move(*table);
}

TEST(LightVisibilityTest, TablesSampleAndWeighByTheSameRow) {
  constexpr TraitBits kUnguided =
      TraitSet(Trait::kAreaLights, Trait::kQuadrics, Trait::kDeltaLights, Trait::kEnvironment);
  constexpr TraitBits kGuided = kUnguided | TraitSet(Trait::kGuiding);
  constexpr Vec3f kP{0.1f, 0.2f, 0}, kN{0, 0, 1};
  for (uint32_t count : {4u, 40u}) {
    const auto table = MakeTable(count);
    LightVisibilityStatistics statistics(table->choice(), 1);
    for (uint32_t i = 0; i < 100 * table->light_count(); ++i) {
      const uint32_t light = i % table->light_count();
      statistics.Add(0, light, light % 2 == 0 || light == count + 1);
    }
    const LightVisibility visibility = statistics.Freeze();
    const LightVisibilityRow row = visibility.RowOf(0);
    int by_kind[3] = {};
    for (int i = 0; i < 4000; ++i) {
      const float u = (static_cast<float>(i) + 0.5f) / 4000;
      const Vec2f u2{0.37f, std::fmod(u * 89, 1.0f)};
      const auto sample = table->Sample<kGuided>(kP, kN, u, u2, {}, row);
      if (!sample) continue;
      if (sample->is_infinite) {
        ++by_kind[0];
        const EnvironmentValue value =
            table->EvalEnvironment<kGuided>(kP, kN, sample->wi, NoWavelengths(), row);
        ASSERT_EQ(sample->pdf, value.pdf);
        ASSERT_EQ(sample->pdf, table->PdfEnvironment<kGuided>(kP, kN, sample->wi, row));
      } else if (sample->is_delta) {
        ++by_kind[1];
        ASSERT_EQ(sample->pdf, table->ChoiceProbability(sample->light, kP, kN, row));
      } else {
        ++by_kind[2];
        const auto pdf = [&](LightVisibilityRow its) {
          return table->PdfEmitter<kGuided>(sample->light, kP, kN, sample->wi, sample->p_light,
                                            its);
        };
        ASSERT_EQ(sample->pdf, pdf(row));
        ASSERT_NE(sample->pdf, pdf({}));
        // Without the trait, the row does not count.
        ASSERT_EQ(pdf({}), table->PdfEmitter<kUnguided>(sample->light, kP, kN, sample->wi,
                                                        sample->p_light, row));
      }
      // In free space, in two steps.
      const auto chosen = table->Choose(kP, u, u2, row);
      ASSERT_TRUE(chosen.has_value());
      ASSERT_EQ(chosen->probability, table->ChoiceProbability(chosen->light, kP, {}, row));
      const auto same = table->SampleChosen<kGuided>(*chosen, kP, u2, {}, row);
      const auto again = table->Sample<kGuided>(kP, {}, u, u2, {}, row);
      ASSERT_EQ(same.has_value(), again.has_value());
      if (same) {
        ASSERT_EQ(same->pdf, again->pdf);
      }
    }
    for (const int found : by_kind) EXPECT_GT(found, 50) << count;
  }
}

// The rows of the limits in the header.
TEST(LightVisibilityTest, MemoryIsBounded) {
  const LightChoice choice(MakeLights(20000, 3));
  EXPECT_EQ(choice.visibility_slot_count(), kLightVisibilitySlotsMax);
  const LightVisibilityStatistics statistics(choice, kLightVisibilityRegionsMax);
  EXPECT_LE(statistics.memory_bytes(), uint64_t{9} << 20);
  const LightVisibility visibility = statistics.Freeze();
  EXPECT_EQ(visibility.Encode().size(), kLightVisibilityBytesMax);
  EXPECT_LE(visibility.memory_bytes(), uint64_t{2} << 20);
}

}  // namespace
}  // namespace sheaf::render
