// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/sampling/map_partition.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace sheaf::render {
namespace {

std::vector<float> Even(int size) {
  return std::vector<float>(static_cast<size_t>(size) * static_cast<size_t>(size), 1.0f);
}

// Steep values, with black parts.
std::vector<float> Random(int size) {
  std::mt19937 engine(7);
  std::vector<float> texels = Even(size);
  for (float& texel : texels) {
    const float v = static_cast<float>(engine() >> 8) * 0x1p-24f;
    texel = v < 0.5f ? 0 : std::pow(v, 8.0f);
  }
  texels[0] = 1;
  return texels;
}

TEST(MapPartitionTest, ConstantMapIsOneSquare) {
  const MapPartition partition(64, Even(64));
  EXPECT_EQ(partition.square_count(), 1u);
  EXPECT_EQ(partition.second_moment_ratio(), 1);
  const MapPartition::Choice choice = partition.Choose({0.25f, 0.5f});
  EXPECT_NEAR(choice.p.x, 16, 1e-4);
  EXPECT_EQ(choice.p.y, 32);
  EXPECT_EQ(choice.pdf, 1);
}

TEST(MapPartitionTest, BlackMapIsEmpty) {
  EXPECT_TRUE(MapPartition(3, std::vector<float>(9)).empty());
  EXPECT_TRUE(MapPartition().empty());
}

TEST(MapPartitionTest, PdfIsNormalizedAndMatchesSamples) {
  std::mt19937 engine(8);
  const auto next = [&] { return static_cast<float>(engine() >> 8) * 0x1p-24f; };
  for (const int size : {1, 2, 3, 7, 32, 50}) {
    const MapPartition partition(size, Random(size));
    double sum = 0;
    const int units = 4 * size;
    for (int y = 0; y < units; ++y) {
      for (int x = 0; x < units; ++x) {
        sum += double{partition.Pdf(
            {(static_cast<float>(x) + 0.5f) / 4, (static_cast<float>(y) + 0.5f) / 4})};
      }
    }
    EXPECT_NEAR(sum / (units * units), 1, 1e-6) << size;
    const auto limit = static_cast<float>(size);
    for (int i = 0; i < 20000; ++i) {
      const MapPartition::Choice choice = partition.Choose({next(), next()});
      ASSERT_TRUE(choice.p.x >= 0 && choice.p.x < limit && choice.p.y >= 0 && choice.p.y < limit);
      ASSERT_GT(choice.pdf, 0);
      ASSERT_EQ(choice.pdf, partition.Pdf(choice.p));
    }
  }
}

TEST(MapPartitionTest, ExtremeRandomNumbersStayInTheMap) {
  const MapPartition partition(50, Random(50));
  constexpr float kLast = 1 - 0x1p-24f;
  for (const Vec2f u : {Vec2f{0, 0}, Vec2f{kLast, kLast}, Vec2f{0, kLast}, Vec2f{kLast, 0}}) {
    const MapPartition::Choice choice = partition.Choose(u);
    EXPECT_EQ(choice.pdf, partition.Pdf(choice.p));
  }
}

// A sun of one texel, far brighter than the sky: its tent is resolved, the sky is not.
TEST(MapPartitionTest, SmallSunIsResolved) {
  constexpr int kSize = 256;
  std::vector<float> texels = Even(kSize);
  texels[100 * kSize + 70] = 1e6f;
  const MapPartition partition(kSize, texels);
  EXPECT_LT(partition.square_count(), 200u);
  EXPECT_LT(partition.second_moment_ratio(), 1.08);
}

// White noise, half of it black: needs squares of quarter texels.
TEST(MapPartitionTest, SteepMapIsFollowed) {
  const MapPartition partition(128, Random(128));
  EXPECT_LT(partition.second_moment_ratio(), 1.3);
}

}  // namespace
}  // namespace sheaf::render
