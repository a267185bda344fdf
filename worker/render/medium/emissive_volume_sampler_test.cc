// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests EmissiveVolumeSampler against its own pdf: the pdf integrates to 1 over all directions, and
// samples follow it, by Pearson's chi-square in cells of the sphere (converted to a normal deviate,
// Wilson and Hilferty 1931; at most 5).
#include "worker/render/medium/emissive_volume_sampler.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "common/math/elementary.h"
#include "common/volume/volume_array.h"
#include "tests/support/flames.h"
#include "worker/render/sampling/event_stream.h"

namespace sheaf::render {
namespace {

using testing::Flame;
using testing::MakeFlame;
using testing::Uneven;

// Rows of equal solid angle.
constexpr int kRows = 24, kColumns = 48, kSub = 16;
Vec3f DirectionAt(double row, double column) {
  const double z = 1 - 2 * row / kRows, phi = 2 * kPi * column / kColumns;
  const double r = std::sqrt(std::max(0.0, 1 - z * z));
  return ToFloat({r * std::cos(phi), r * std::sin(phi), z});
}

void ExpectSamplesFit(const EmissiveVolumeSampler& lights, Vec3f p, uint32_t seed) {
  constexpr int kSamples = 200000;
  std::vector<double> expected(kRows * kColumns), observed(kRows * kColumns);
  double total = 0;
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      double sum = 0;
      for (int i = 0; i < kSub * kSub; ++i) {
        const Vec3f w =
            DirectionAt(row + (i / kSub + 0.5) / kSub, column + (i % kSub + 0.5) / kSub);
        sum += double{lights.Pdf(p, w)};
      }
      const double probability = sum * 4 * kPi / (kRows * kColumns * kSub * kSub);
      expected[static_cast<size_t>(row * kColumns + column)] = probability * kSamples;
      total += probability;
    }
  }
  EXPECT_NEAR(total, 1, 5e-3);
  EventStream random({seed, 7, 8, 9});
  const auto next = [&] { return static_cast<float>(random.Uniform() * (1 - 0x1p-24)); };
  double inverse = 0;
  for (int i = 0; i < kSamples; ++i) {
    const EmissiveVolumeSampler::Sample sample =
        lights.SampleFrom(p, {next(), next(), next(), next()});
    ASSERT_GT(sample.pdf, 0);
    ASSERT_EQ(sample.pdf, lights.Pdf(p, sample.w));
    ASSERT_NEAR(Length(sample.w), 1, 1e-6f);
    inverse += 1 / double{sample.pdf};
    const double phi = std::atan2(double{sample.w.y}, double{sample.w.x});
    const int row = static_cast<int>((1 - double{sample.w.z}) / 2 * kRows);
    const int column = static_cast<int>((phi < 0 ? phi + 2 * kPi : phi) / (2 * kPi) * kColumns);
    observed[static_cast<size_t>(std::min(row, kRows - 1) * kColumns +
                                 std::min(column, kColumns - 1))] += 1;
  }
  double statistic = 0, rest_expected = 0, rest_observed = 0;
  int cells = 0;
  for (size_t i = 0; i < expected.size(); ++i) {
    // Cells at the silhouette of the emission are only resolved to the size of their parts.
    if (expected[i] < 50) {
      rest_expected += expected[i];
      rest_observed += observed[i];
      continue;
    }
    const double e = expected[i] / total;
    statistic += (observed[i] - e) * (observed[i] - e) / e;
    ++cells;
  }
  EXPECT_NEAR(rest_observed, rest_expected, 0.02 * kSamples);
  const double k = std::max(cells - 1, 1);
  const double deviate = (std::cbrt(statistic / k) - (1 - 2 / (9 * k))) / std::sqrt(2 / (9 * k));
  EXPECT_LE(deviate, 5) << cells << " cells";
  EXPECT_GT(cells, 20);
}

TEST(EmissiveVolumeSamplerTest, SamplesFollowThePdf) {
  const Flame one = MakeFlame(Uneven(1), {}),
              other =
                  MakeFlame(Uneven(2), {{0, 0.5, 0}, {-0.5, 0, 0.2}, {0, 0, 0.7}, {-1, 4, 0.3}});
  const EmissiveVolumeSampler lights({one.source(), other.source({0.2f, 2, 0.1f})});
  ASSERT_FALSE(lights.empty());
  uint32_t seed = 0;
  // Outside, between the two, inside, and on a face.
  for (const Vec3f p :
       {Vec3f{1, 1, 3}, Vec3f{0.3f, 2.6f, 0.5f}, Vec3f{1.4f, 0.9f, 0.45f}, Vec3f{1.5f, 1, 1}}) {
    SCOPED_TRACE(++seed);
    ExpectSamplesFit(lights, p, seed);
  }
}

// Scaling by powers of two changes exponents only.
TEST(EmissiveVolumeSamplerTest, PdfsAreScaleInvariant) {
  const auto pdf_at = [](double scale, Vec3f w) {
    const Affine place{{scale, 0, 0}, {0, scale, 0}, {0, 0, scale}, {0, 0, 0}};
    const Flame flame = MakeFlame(Uneven(4), place);
    const EmissiveVolumeSampler lights({flame.source()});
    const auto size = static_cast<float>(scale);
    return lights.Pdf({1.5f * size, 1.05f * size, -8 * size}, w);
  };
  const Vec3f slanted = Normalize(Vec3f{0.05f, -0.03f, 1});
  for (const Vec3f w : {Vec3f{0, 0, 1}, slanted}) {
    EXPECT_GT(pdf_at(1, w), 10);
    EXPECT_EQ(pdf_at(0x1p-20, w), pdf_at(1, w));
    EXPECT_EQ(pdf_at(0x1p20, w), pdf_at(1, w));
    EXPECT_EQ(pdf_at(1, -w), 0);
  }
  EXPECT_EQ(pdf_at(1, {1, 0, 0}), 0);
}

TEST(EmissiveVolumeSamplerTest, NonEmissiveMediaAreNoLights) {
  const Flame dark = MakeFlame(std::vector<float>(48, 0.0f), {});
  const Flame bright = MakeFlame(Uneven(3), {});
  EXPECT_TRUE(EmissiveVolumeSampler().empty());
  EXPECT_TRUE(EmissiveVolumeSampler(std::vector<EmissiveVolumeSampler::Source>{}).empty());
  EXPECT_TRUE(EmissiveVolumeSampler({dark.source()}).empty());
  EXPECT_TRUE(EmissiveVolumeSampler({bright.source(Rgb{})}).empty());
  EXPECT_FALSE(EmissiveVolumeSampler({dark.source(), bright.source()}).empty());
}

// An emitter that moves from the left end of the box to its middle is sampled there, too.
TEST(EmissiveVolumeSamplerTest, MovingMediaAreSampledAtTheirTime) {
  std::vector<float> values(48);
  for (size_t i = 0; i < values.size(); i += 6) values[i] = 1;
  const Flame still = MakeFlame(values, {});
  Flame moving = MakeFlame(values, {});
  const std::vector<Vec3f> wind(8, {1.5f, 0, 0});
  auto grid = VolumeGridFromArray("a", "density", {{6, 4, 2}, {0, 0, 0}, {3, 2, 1}}, values);
  auto velocities = VolumeGridFromArray("a", "vel", {{2, 2, 2}, {-9, -9, -9}, {9, 9, 9}},
                                        std::span<const Vec3f>(wind));
  auto motion = VolumeMotion::Make("a", *std::move(velocities), 1, *grid);
  ASSERT_TRUE(motion.ok()) << motion.status();
  auto density = HeterogeneousMedium::FromMovingGrid("a", *std::move(grid), *std::move(motion), {});
  ASSERT_TRUE(density.ok()) << density.status();
  moving.density.emplace(*std::move(density));
  const EmissiveVolumeSampler where_it_is({still.source()}), where_it_comes({moving.source()});
  const Vec3f down{0, 0, -1};
  EXPECT_GT(where_it_is.Pdf({0.25f, 1, 5}, down), 0);
  EXPECT_EQ(where_it_is.Pdf({1.25f, 1, 5}, down), 0);
  for (const float x : {0.25f, 0.75f, 1.25f}) EXPECT_GT(where_it_comes.Pdf({x, 1, 5}, down), 0);
  EXPECT_EQ(where_it_comes.Pdf({2.9f, 1, 5}, down), 0);
}

}  // namespace
}  // namespace sheaf::render
