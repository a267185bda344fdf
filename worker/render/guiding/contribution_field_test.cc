// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/guiding/contribution_field.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "worker/render/guiding/contribution_statistics.h"

namespace sheaf::render {
namespace {

constexpr int32_t kWidthPx = 19, kHeightPx = 11;
constexpr uint32_t kRegions = 3;

ContributionGrid SmallGrid() { return ContributionGridFor(kWidthPx, kHeightPx, 2000); }

// Region 0 scatters 0 or twice 2^26, region 1 always 2^26, region 2 nothing. Paths bring 0 or twice
// 2^26. Vertices take 4 rays, paths 9.
void AddLight(double scale, ContributionStatistics* statistics) {
  for (int i = 0; i < 1000; ++i) {
    const double always = 0x1p26 * scale, sometimes = i % 2 == 0 ? 2 * always : 0;
    statistics->AddVertex(0, sometimes, 4);
    statistics->AddVertex(1, always, 4);
    statistics->AddVertex(2, 0, 4);
    statistics->AddPath(i % kWidthPx, i % kHeightPx, sometimes, 9);
  }
}
ContributionField FieldOf(double scale, int unit_exponent) {
  ContributionStatistics statistics(kRegions, SmallGrid(), unit_exponent);
  AddLight(scale, &statistics);
  return statistics.Freeze();
}
float NumberAt(const ContributionField& field, uint32_t region) {
  return field.PixelFactor(5, 5) * field.RegionFactor(region);
}

TEST(ContributionGridTest, BlocksCoverTheFrameWithinTheLimits) {
  struct Frame {
    int32_t width_px, height_px;
    uint64_t paths;
  };
  for (const Frame& frame : {Frame{1, 1, 1}, Frame{19, 11, 2000}, Frame{1920, 1080, 1u << 19},
                             Frame{std::numeric_limits<int32_t>::max(), 3, 1u << 19},
                             Frame{1 << 20, 1 << 20, uint64_t{1} << 40}}) {
    const ContributionGrid grid = ContributionGridFor(frame.width_px, frame.height_px, frame.paths);
    EXPECT_LE(grid.size(), kContributionBlocksMax);
    EXPECT_TRUE(grid.size() == 1 || grid.size() * kContributionBlockPaths <= frame.paths);
    EXPECT_GE(grid.block_bits, kContributionBlockBitsMin);
    EXPECT_EQ(grid.BlockOf(0, 0), 0u);
    EXPECT_EQ(grid.BlockOf(frame.width_px - 1, frame.height_px - 1), grid.size() - 1);
    EXPECT_EQ(grid.BlockOf(-5, -5), 0u);
    EXPECT_EQ(grid.BlockOf(std::numeric_limits<int32_t>::max(), frame.height_px), grid.size() - 1);
  }
}

// The number by hand. Pixels of all blocks vary as much, by about their mean.
TEST(ContributionFieldTest, NumberIsThatOfLeastErrorTimesCost) {
  ContributionStatistics statistics(1, ContributionGridFor(4, 4, 64), 0);
  for (int i = 0; i < 4000; ++i) {
    statistics.AddVertex(0, i % 4 == 0 ? 65536 : 0, 4);
    statistics.AddPath(i % 4, 0, i % 2 == 0 ? 32768 : 0, 9);
  }
  const ContributionField field = statistics.Freeze();
  const double pixel = 16384 * std::sqrt(1 + kContributionDark * kContributionDark);
  const double sample = 16384 / pixel, vertex = 16384 * std::sqrt(3.0);
  const double expected =
      kContributionEagerness * (vertex / std::sqrt(4.0)) / pixel * (std::sqrt(9.0) / sample);
  EXPECT_NEAR(static_cast<double>(field.PixelFactor(1, 2) * field.RegionFactor(0)), expected,
              1e-4 * expected);
}

TEST(ContributionFieldTest, RegionsWithoutVarianceOrLightAreNotSplit) {
  const ContributionField field = FieldOf(1, 0);
  EXPECT_EQ(field.region_count(), kRegions);
  EXPECT_GT(NumberAt(field, 0), 2 * NumberAt(field, 1));
  EXPECT_EQ(NumberAt(field, 2), 0);
  EXPECT_EQ(field.RegionFactor(kRegions), 0);
}

TEST(ContributionFieldTest, IsEmptyWithoutLight) {
  ContributionStatistics statistics(kRegions, SmallGrid(), 0);
  EXPECT_TRUE(statistics.Freeze().empty());
  for (const double bad : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity()}) {
    statistics.AddVertex(1, bad, 3);
    statistics.AddPath(2, 2, bad, 3);
  }
  EXPECT_TRUE(statistics.Freeze().empty());
}

// Samples that do not vary need no further paths.
TEST(ContributionFieldTest, EvenImagesAreNotSplit) {
  ContributionStatistics statistics(1, ContributionGridFor(4, 4, 64), 0);
  for (int i = 0; i < 100; ++i) {
    statistics.AddVertex(0, i % 2 == 0 ? 8192 : 0, 4);
    statistics.AddPath(1, 1, 4096, 9);
  }
  EXPECT_EQ(NumberAt(statistics.Freeze(), 0), 0);
}

TEST(ContributionFieldTest, PowersOfTwoChangeNoNumber) {
  const ContributionField field = FieldOf(1, 0);
  for (const int exponent : {-20, 20, 60}) {
    const ContributionField scaled = FieldOf(std::ldexp(1.0, exponent), exponent);
    for (uint32_t region = 0; region < kRegions; ++region) {
      EXPECT_EQ(NumberAt(scaled, region), NumberAt(field, region)) << exponent;
      EXPECT_EQ(scaled.RegionFactor(region), std::ldexp(field.RegionFactor(region), exponent));
    }
  }
}

TEST(ContributionFieldTest, LightBeyondFloatHasNoFactors) {
  const ContributionField field = FieldOf(0x1p300, 300);
  ASSERT_FALSE(field.empty());
  EXPECT_EQ(NumberAt(field, 0), 0);
  EXPECT_TRUE(ContributionField::Decode(field.Encode()).ok());
}

TEST(ContributionFieldTest, ThreadsChangeNoByte) {
  const auto bytes_of = [](int threads) {
    ContributionStatistics statistics(kRegions, SmallGrid(), 0);
    {
      std::vector<std::jthread> adding;
      for (int i = 0; i < threads; ++i) {
        adding.emplace_back([&] {
          for (int k = 0; k < 4 / threads; ++k) AddLight(1, &statistics);
        });
      }
    }
    return statistics.Freeze().Encode();
  };
  EXPECT_TRUE(bytes_of(1) == bytes_of(4));
}

TEST(ContributionFieldTest, RoundTrips) {
  const ContributionField field = FieldOf(1, 0);
  const std::string bytes = field.Encode();
  EXPECT_LE(bytes.size(), kContributionBytesMax);
  const absl::StatusOr<ContributionField> back = ContributionField::Decode(bytes);
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_TRUE(back->Encode() == bytes);
  for (int32_t x = -1; x <= kWidthPx; ++x)
    EXPECT_EQ(back->PixelFactor(x, 3), field.PixelFactor(x, 3));
}

TEST(ContributionFieldTest, DamageIsRefused) {
  const std::string bytes = FieldOf(1, 0).Encode();
  const auto expect_refused = [](const std::string& damaged) {
    const absl::Status refused = ContributionField::Decode(damaged).status();
    EXPECT_EQ(refused.code(), absl::StatusCode::kDataLoss) << refused;
  };
  for (size_t size = 0; size < bytes.size(); size += 3) expect_refused(bytes.substr(0, size));
  expect_refused(bytes + '\0');
  expect_refused(std::string(kContributionBytesMax + 1, '\0'));
  // Magic, version, each size, block bits, number of regions, and the signs of factors.
  for (const size_t at : {0u, 4u, 8u, 11u, 12u, 15u, 16u, 19u, 20u, 23u, 27u}) {
    std::string damaged = bytes;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x80);
    expect_refused(damaged);
  }
  std::string not_finite = bytes;
  not_finite.replace(bytes.size() - 4, 4, std::string("\x00\x00\xc0\x7f", 4));
  expect_refused(not_finite);
}

}  // namespace
}  // namespace sheaf::render
