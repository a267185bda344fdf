// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Rows of lights, from tries to choices, and their bytes.
#include "worker/render/guiding/light_rows.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "common/base/parallel.h"
#include "worker/render/guiding/light_tries.h"

namespace sheaf::render {
namespace {

using ::testing::HasSubstr;

// A square of rooms of side 1, each with four lamps below its ceiling; the last lights are
// infinite.
constexpr int kRoomsAcross = 10;
constexpr uint32_t kLampsInRoom = 4;

std::vector<LightBounds> MakeRooms(int across, size_t infinite_count = 0, float scale = 1,
                                   float brightness = 1) {
  std::vector<LightBounds> lights;
  for (int room = 0; room < across * across; ++room) {
    const auto x = static_cast<float>(room % across), y = static_cast<float>(room / across);
    for (const Vec3f at : {Vec3f{0.25f, 0.25f, 0.9f}, Vec3f{0.75f, 0.25f, 0.9f},
                           Vec3f{0.25f, 0.75f, 0.9f}, Vec3f{0.75f, 0.75f, 0.9f}}) {
      lights.push_back({.kind = LightBounds::Kind::kSphere,
                        .center = (Vec3f{x, y, 0} + at) * scale,
                        .radius = 0.05f * scale,
                        .area = 0.0314f * scale * scale,
                        .strength = brightness});
    }
  }
  for (size_t i = 0; i < infinite_count; ++i) {
    lights.push_back({.kind = LightBounds::Kind::kInfinite, .strength = 0.01f * brightness});
  }
  return lights;
}

Vec3f InRoom(int room, int across) {
  return Vec3f{static_cast<float>(room % across) + 0.4f, static_cast<float>(room / across) + 0.45f,
               0.1f};
}

// Tries from points of each room, of which only its own lamps are seen, as the choice makes them.
void TryLamps(const LightChoice& choice, int across, int tries, float scale, float brightness,
              LightTries* into, int thread_count = 1) {
  const auto total = static_cast<uint64_t>(across) * across * tries;
  ParallelRanges(total, 64, thread_count, [&](uint64_t begin, uint64_t end) {
    for (uint64_t i = begin; i < end; ++i) {
      const int room = static_cast<int>(i % (static_cast<uint64_t>(across) * across));
      const auto fraction = [&](double step) {
        const double x = static_cast<double>(i + 1) * step;
        return static_cast<float>(x - std::floor(x));
      };
      const Vec3f p =
          (Vec3f{static_cast<float>(room % across), static_cast<float>(room / across), 0.05f} +
           Vec3f{0.1f + 0.8f * fraction(0.7548776662466927),
                 0.1f + 0.8f * fraction(0.5698402909980532), 0}) *
          scale;
      const auto chosen = choice.Choose(p, {0, 0, 1}, fraction(0.6180339887498949), 0);
      if (!chosen) continue;
      const bool is_seen = chosen->light / kLampsInRoom == static_cast<uint32_t>(room);
      into->Add({{p, {0, 0, 1}},
                 chosen->light,
                 is_seen,
                 is_seen ? 0.25 * static_cast<double>(brightness / chosen->probability) : 0.0});
    }
  });
}

Bounds BoxOf(int across, float scale) {
  Bounds box;
  box.Add(Vec3d{0, 0, 0});
  box.Add(Vec3d{across * static_cast<double>(scale), across * static_cast<double>(scale),
                static_cast<double>(scale)});
  return box;
}

// The probability of the room's own lamps.
double OwnLamps(const LightChoice& choice, int room, Vec3f p, LightVisibilityRow row) {
  double sum = 0;
  for (uint32_t i = 0; i < kLampsInRoom; ++i) {
    sum += static_cast<double>(
        choice.Probability(static_cast<uint32_t>(room) * kLampsInRoom + i, p, {0, 0, 1}, row));
  }
  return sum;
}

TEST(LightRowsTest, RoomsLearnTheirOwnLamps) {
  const LightChoice choice(MakeRooms(kRoomsAcross));
  LightTries tries(choice);
  TryLamps(choice, kRoomsAcross, 1000, 1, 1, &tries);
  const GuidingField regions = tries.MakeRegions(BoxOf(kRoomsAcross, 1));
  const LightVisibility rows = tries.Learn(regions);
  ASSERT_EQ(rows.region_count(), regions.region_count());
  double learned = 0, plain = 0;
  for (int room = 0; room < kRoomsAcross * kRoomsAcross; ++room) {
    const Vec3f p = InRoom(room, kRoomsAcross);
    const LightVisibilityRow row = rows.RowOf(regions.RegionIndexAt({p, {0, 0, 1}}));
    learned += OwnLamps(choice, room, p, row);
    plain += OwnLamps(choice, room, p, {});
    // A part of all choices ignores what was learned.
    for (uint32_t i = 0; i < kLampsInRoom * kRoomsAcross * kRoomsAcross; i += 7) {
      ASSERT_GE(choice.Probability(i, p, {}, row),
                0.09f / (kLampsInRoom * kRoomsAcross * kRoomsAcross));
    }
  }
  constexpr double kRooms = kRoomsAcross * kRoomsAcross;
  std::printf("own lamps: %g plain, %g learned, %zu regions\n", plain / kRooms, learned / kRooms,
              regions.region_count());
  EXPECT_LT(plain / kRooms, 0.5);
  EXPECT_GT(learned / kRooms, 0.6);
}

// As many of equally spaced choices as the probability says, and the same bits.
TEST(LightRowsTest, ChoicesFollowTheProbabilitiesOfCuts) {
  constexpr int kDraws = 1 << 14;
  for (const int across : {3, 6}) {
    const std::vector<LightBounds> lights = MakeRooms(across, 2);
    for (const bool splits : {false, true}) {
      const LightChoice choice(lights, splits);
      LightTries tries(choice);
      TryLamps(choice, across, 300, 1, 1, &tries);
      const GuidingField regions = tries.MakeRegions(BoxOf(across, 1));
      const LightVisibility rows = tries.Learn(regions);
      for (const int room : {0, 4, across * across - 1}) {
        const Vec3f p = InRoom(room, across), n{0, 0, 1};
        const LightVisibilityRow row = rows.RowOf(regions.RegionIndexAt({p, n}));
        ASSERT_NE(row.links, nullptr);
        std::vector<int> counts(lights.size());
        for (int i = 0; i < kDraws; ++i) {
          const auto chosen = choice.Choose(p, n, (static_cast<float>(i) + 0.5f) / kDraws, 0, row);
          ASSERT_TRUE(chosen.has_value());
          ASSERT_EQ(chosen->probability, choice.Probability(chosen->light, p, n, row));
          ++counts[chosen->light];
        }
        double sum = 0, chi_square = 0;
        for (uint32_t i = 0; i < lights.size(); ++i) {
          const auto probability = static_cast<double>(choice.Probability(i, p, n, row));
          sum += probability;
          EXPECT_EQ(probability > 0, choice.Probability(i, p, n) > 0);
          const double expected = probability * kDraws;
          ASSERT_NEAR(counts[i], expected, 3);
          if (expected > 0)
            chi_square += (counts[i] - expected) * (counts[i] - expected) / expected;
        }
        EXPECT_NEAR(sum, 1, 1e-5);
        EXPECT_LT(chi_square, static_cast<double>(lights.size()));
        if (!splits) continue;
        const LightCut cut = choice.CutAt(p, n, 8, row);
        for (size_t part = 0; part < cut.size(); ++part) {
          for (const float u : {0.1f, 0.5f, 0.9f}) {
            const ChosenLight chosen = choice.ChooseFrom(cut, part, p, n, u, 0, row);
            EXPECT_EQ(chosen.probability,
                      choice.Probability(chosen.light, p, n,
                                         SplitLightQuery<LightVisibilityRow>{row, 8}));
          }
        }
      }
    }
  }
}

TEST(LightRowsTest, ScaleThreadsAndOrderChangeNoByte) {
  constexpr int kAcross = 5;
  const auto bytes_of = [](float scale, float brightness, int thread_count) {
    const LightChoice choice(MakeRooms(kAcross, 1, scale, brightness));
    LightTries tries(choice);
    // A light's irradiance does not depend on the scene's scale: its area and distance do.
    TryLamps(choice, kAcross, 200, scale, brightness, &tries, thread_count);
    const GuidingField regions = tries.MakeRegions(BoxOf(kAcross, scale));
    EXPECT_GT(regions.region_count(), 20u);
    return tries.Learn(regions).Encode();
  };
  const std::string bytes = bytes_of(1, 1, 1);
  EXPECT_EQ(bytes_of(1, 1, 4), bytes);
  for (const float factor : {0x1p-20f, 0x1p20f}) {
    EXPECT_EQ(bytes_of(factor, 1, 3), bytes);
    EXPECT_EQ(bytes_of(1, factor, 3), bytes);
    EXPECT_EQ(bytes_of(factor, factor, 1), bytes);
  }
}

TEST(LightRowsTest, WhatLightsBringAgainstTheEstimateIsLearned) {
  const LightChoice choice(MakeRooms(1));
  std::vector<LightTry> tries;
  const auto unit = static_cast<uint32_t>(kLightTryUnit);
  for (uint32_t i = 0; i < 4000; ++i) {
    // Lamps bring 1, 1/2, 1/4 and 1/64 of the estimate.
    const uint32_t light = i % 4, part = light == 3 ? 64 : 1u << light;
    tries.push_back({0, light, unit, unit / part, true});
  }
  const LightVisibility rows = LearnLightRows(choice, 1, tries);
  const LightVisibilityRow row = rows.RowOf(0);
  EXPECT_EQ(VisibilityFactor(row, 0), 1);
  EXPECT_NEAR(VisibilityFactor(row, 1), 0.5, 0.02);
  EXPECT_NEAR(VisibilityFactor(row, 2), 0.25, 0.02);
  // Not less than 1/4 of the mean, which is 0.44.
  EXPECT_NEAR(VisibilityFactor(row, 3), 0.11, 0.02);
  EXPECT_GE(VisibilityFactor(row, 3), 1 / 16.0f);
}

TEST(LightRowsTest, RegionsWithoutTriesKnowNothing) {
  for (const int across : {1, 4}) {
    const LightChoice choice(MakeRooms(across, 1));
    const LightVisibility rows = LearnLightRows(choice, 2, {});
    const Vec3f p{0.3f, 0.6f, 0.2f};
    for (uint32_t i = 0; i < kLampsInRoom; ++i) {
      EXPECT_EQ(choice.Probability(i, p, {}, rows.RowOf(1)), choice.Probability(i, p, {}));
    }
  }
  EXPECT_EQ(LearnLightRows(LightChoice(), 3, {}).RowOf(0).steps, nullptr);
}

TEST(LightRowsTest, BytesComeBackWholeAndOthersAreRefused) {
  for (const int across : {1, 3}) {
    const LightChoice choice(MakeRooms(across, 1));
    LightTries tries(choice);
    TryLamps(choice, across, 300, 1, 1, &tries);
    const GuidingField regions = tries.MakeRegions(BoxOf(across, 1));
    const std::string bytes = tries.Learn(regions).Encode();
    EXPECT_LE(bytes.size(), kLightVisibilityBytesMax);
    const auto decoded = LightVisibility::Decode(bytes, choice);
    ASSERT_TRUE(decoded.ok()) << decoded.status();
    EXPECT_EQ(decoded->Encode(), bytes);
    EXPECT_EQ(decoded->region_count(), regions.region_count());
    const auto expect_refused = [&](const std::string& wrong, const std::string& why) {
      const auto other = LightVisibility::Decode(wrong, choice);
      ASSERT_FALSE(other.ok()) << why;
      EXPECT_EQ(other.status().code(), absl::StatusCode::kDataLoss);
      EXPECT_THAT(other.status().message(), HasSubstr(why));
    };
    for (size_t size = 0; size < bytes.size(); ++size) expect_refused(bytes.substr(0, size), "");
    expect_refused(bytes + '\xff', "");
    // Any other byte is refused, or belongs to a row that Encode could have written.
    for (size_t at = 0; at < std::min<size_t>(bytes.size(), 200); ++at) {
      for (int flip = 1; flip < 256; flip += 3) {
        std::string wrong = bytes;
        wrong[at] = static_cast<char>(wrong[at] ^ flip);
        const auto other = LightVisibility::Decode(wrong, choice);
        if (other.ok()) {
          ASSERT_EQ(other->Encode(), wrong);
        }
      }
    }
    std::mt19937_64 engine(7);
    for (int i = 0; i < 2000; ++i) {
      std::string garbage = i % 2 == 0 ? std::string("SLC1\x01\x00\x00\x00", 8) : "SLC1";
      for (uint64_t size = engine() % 100; size > 0; --size) {
        garbage.push_back(static_cast<char>(engine() % 9));
      }
      expect_refused(garbage, "");
    }
  }
  const LightChoice few(MakeRooms(1));
  EXPECT_FALSE(LightVisibility::Decode(std::string("SLC1\x01\x00\x00\x00", 8), few).ok());
}

}  // namespace
}  // namespace sheaf::render
