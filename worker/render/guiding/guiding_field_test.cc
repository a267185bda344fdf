// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/guiding/guiding_field.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "tests/support/chi_square.h"
#include "tests/support/made_up_light.h"
#include "worker/render/guiding/guiding_statistics.h"

namespace sheaf::render {
namespace {

constexpr double kUniform = 1 / (4 * kPi);
constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

double PdfAt(const GuidingRegion& region, Vec3f w) { return static_cast<double>(region.Pdf(w)); }

// The integral of the density over each of side^2 equal squares of the map, from the middles of
// the smallest quads.
std::vector<double> Integrals(const GuidingRegion& region, size_t side) {
  constexpr size_t kQuads = size_t{1} << kGuidingQuadDepthMax;
  std::vector<double> integrals(side * side);
  for (size_t y = 0; y < kQuads; ++y) {
    for (size_t x = 0; x < kQuads; ++x) {
      const Vec3f w = DirectionOf((static_cast<double>(x) + 0.5) / kQuads,
                                  (static_cast<double>(y) + 0.5) / kQuads);
      integrals[y * side / kQuads * side + x * side / kQuads] += PdfAt(region, w);
    }
  }
  for (double& integral : integrals) integral *= 4 * kPi / (kQuads * kQuads);
  return integrals;
}

TEST(GuidingFieldTest, DensityIntegratesToOne) {
  const GuidingField field = Train(SkyAndSource, 3, 5000);
  const GuidingRegion* region = field.RegionAt({0.3f, -0.4f, 0.5f});
  ASSERT_NE(region, nullptr);
  EXPECT_NEAR(Integrals(*region, 1)[0], 1, 1e-6);
}

TEST(GuidingFieldTest, SamplesFollowTheDensity) {
  constexpr size_t kSide = 32;
  constexpr int kSamples = 1 << 19;
  const GuidingField field = Train(SkyAndSource, 3, 5000);
  const GuidingRegion* region = field.RegionAt({0.3f, -0.4f, 0.5f});
  ASSERT_NE(region, nullptr);
  std::vector<int> counts(kSide * kSide);
  for (uint64_t i = 0; i < kSamples; ++i) {
    const std::array<float, 3> u = sheaf::testing::CounterUniforms(3, i);
    const Vec3f w = region->Sample({u[0], u[1]});
    ASSERT_NEAR(LengthSquared(w), 1, 1e-6f);
    ASSERT_GE(PdfAt(*region, w), kUniform * kGuidingUniformShare * 0.999);
    const Vec2f st = EqualAreaSphereToSquare(w);
    const auto cell = [](float s) { return std::min(static_cast<size_t>(s * kSide), kSide - 1); };
    ++counts[cell(st.y) * kSide + cell(st.x)];
  }
  const std::vector<double> integrals = Integrals(*region, kSide);
  double statistic = 0;
  for (size_t i = 0; i < counts.size(); ++i) {
    const double expected = integrals[i] * kSamples;
    ASSERT_GT(expected, 5);
    statistic += (counts[i] - expected) * (counts[i] - expected) / expected;
  }
  EXPECT_GT(sheaf::testing::UpperGammaQ((kSide * kSide - 1) / 2.0, statistic / 2), 1e-3);
}

// An even grid of random numbers puts as many samples into each half of the sphere as it holds.
TEST(GuidingFieldTest, StratificationSurvives) {
  constexpr int kSide = 64;
  const GuidingField field = Train(SkyAndSource, 3, 5000);
  const GuidingRegion* region = field.RegionAt({0, 0, 0});
  ASSERT_NE(region, nullptr);
  int count = 0;
  for (int i = 0; i < kSide * kSide; ++i) {
    const Vec2f u{(static_cast<float>(i % kSide) + 0.5f) / kSide,
                  (static_cast<float>(i / kSide) + 0.5f) / kSide};
    count += EqualAreaSphereToSquare(region->Sample(u)).x > 0.5f;
  }
  const std::vector<double> quarters = Integrals(*region, 2);
  // Each row of the grid rounds once, in each of two rows of quads.
  EXPECT_NEAR(count, (quarters[1] + quarters[3]) * kSide * kSide, kSide);
}

TEST(GuidingFieldTest, ExtremeRandomNumbersGiveDirections) {
  constexpr float kLast = 1 - 0x1p-24f;
  const GuidingField field = Train(SkyAndSource, 4, 5000);
  const GuidingRegion* region = field.RegionAt({0, 0, 0});
  ASSERT_NE(region, nullptr);
  for (const float x : {0.0f, 0x1p-149f, 0.5f, kLast}) {
    for (const float y : {0.0f, 0x1p-149f, 0.5f, kLast}) {
      const Vec3f w = region->Sample({x, y});
      EXPECT_NEAR(LengthSquared(w), 1, 1e-6f);
      EXPECT_GE(PdfAt(*region, w), kUniform * kGuidingUniformShare * 0.999);
    }
  }
  EXPECT_TRUE(std::isfinite(region->Pdf({kNan, kNan, kNan})));
}

// A source that a few of the first 20,000 paths hit. Half of the later ones follow the field.
TEST(GuidingFieldTest, SmallSourceIsFound) {
  const auto light = [](Vec3f w) { return Dot(w, kSource) > 0.9992f ? 2500 : 0.5; };
  GuidingField field(BoxOf());
  for (int k = 0; k < 4; ++k) {
    GuidingStatistics statistics(field, -20);
    for (uint64_t i = 0; i < uint64_t{20000} << k; ++i) {
      const Found even = FindLight(SkyAndSource, i);
      const GuidingRegion* region = field.RegionAt({even.p});
      const std::array<float, 3> u = sheaf::testing::CounterUniforms(6, i);
      const Vec3f w = region != nullptr && u[2] < 0.5f ? region->Sample({u[0], u[1]}) : even.w;
      const double pdf = region != nullptr ? (kUniform + PdfAt(*region, w)) / 2 : kUniform;
      statistics.Add(Reported(even.p, w, light(w) / pdf));
    }
    GuidingField next = Refine(field, statistics, k);
    field = next;
  }
  EXPECT_GT(field.region_count(), 8u);
  // The source is 4e-4 of the sphere. Its mean density counts: single quads may be missed.
  constexpr int kPoints = 100, kDraws = 200;
  double density = 0;
  for (uint64_t i = 0; i < kPoints; ++i) {
    const GuidingRegion* region = field.RegionAt({FindLight(SkyAndSource, i).p});
    ASSERT_NE(region, nullptr);
    ASSERT_LT(PdfAt(*region, -kSource), kUniform);
    density += PdfAt(*region, kSource) / kPoints;
    int hits = 0;
    for (uint64_t n = 0; n < kDraws; ++n) {
      const std::array<float, 3> u = sheaf::testing::CounterUniforms(7 + i, n);
      hits += Dot(region->Sample({u[0], u[1]}), kSource) > 0.9992f;
    }
    ASSERT_GT(hits, 50 * 4e-4 * kDraws) << i;
  }
  EXPECT_GT(density, 50 * kUniform);
}

TEST(GuidingFieldTest, ScatteredLightIsTheMeanOfValues) {
  const auto light = [](Vec3f, Vec3f w) { return w.z > 0 ? 3.0 : 1.0; };
  const GuidingField field = Train(light, 2, 20000);
  const GuidingRegion* region = field.RegionAt({0.1f, 0.2f, 0.3f});
  ASSERT_NE(region, nullptr);
  EXPECT_NEAR(region->ScatteredLight(), 8 * kPi, 1);
}

TEST(GuidingFieldTest, SidesOfAWallLearnTheirOwnDirections) {
  const auto light = [](Vec3f p, Vec3f w) { return (p.x < 0) == (w.z > 0.8f) ? 1.0 : 0.01; };
  const GuidingField field = Train(light, 3, 10000);
  EXPECT_GT(field.region_count(), 8u);
  const GuidingRegion *left = field.RegionAt({-0.1f, 0.2f, 0.3f}),
                      *right = field.RegionAt({0.1f, 0.2f, 0.3f});
  ASSERT_NE(left, nullptr);
  ASSERT_NE(right, nullptr);
  constexpr Vec3f kUp{0, 0, 1};
  EXPECT_GT(PdfAt(*left, kUp), 10 * PdfAt(*right, kUp));
}

// The same for both faces of a wall without thickness.
TEST(GuidingFieldTest, FacesOfASurfaceLearnTheirOwnDirections) {
  constexpr Vec3f kUp{0, 0, 1}, kTilted{0.3f, -0.2f, 0.9f};
  // The first iteration divides the field.
  GuidingField next(BoxOf());
  for (int k = 0; k < 2; ++k) {
    GuidingStatistics statistics(next, -20);
    for (uint64_t i = 0; i < 20000; ++i) {
      FoundLight found = Reported(FindLight(SkyAndSource, i));
      found.from.p.z = 0;
      found.from.n = i % 2 == 0 ? kTilted : -kTilted;
      if (Dot(found.w, found.from.n) <= 0) found.scattered = 0;
      statistics.Add(found);
    }
    GuidingField refined = Refine(next, statistics, k);
    next = refined;
  }
  const GuidingRegion *above = next.RegionAt({{0.1f, 0.2f, 0}, kUp}),
                      *below = next.RegionAt({{0.1f, 0.2f, 0}, -kUp});
  ASSERT_NE(above, nullptr);
  ASSERT_NE(below, nullptr);
  EXPECT_GT(PdfAt(*above, kTilted), 10 * PdfAt(*below, kTilted));
  EXPECT_GT(PdfAt(*below, -kTilted), 10 * PdfAt(*above, -kTilted));
  // Samples without a normal, and those of another axis, are not theirs.
  EXPECT_NE(next.RegionAt({{0.1f, 0.2f, 0}, {}}), above);
  EXPECT_NE(next.RegionAt({{0.1f, 0.2f, 0}, {1, 0, 0}}), above);
}

// Paths that follow the field find all of the light, or those that follow scattering do.
TEST(GuidingFieldTest, SharesFollowWhoFindsTheLight) {
  const struct {
    double scattering_part;
    float expected;
  } cases[] = {{0.02, kGuidedShareMax}, {0.5, kGuidedShareStart}, {0.98, kGuidedShareMin}};
  for (const auto& c : cases) {
    GuidingField field = Train(SkyAndSource, 1, 1000);
    GuidingStatistics statistics(field, -20);
    for (uint64_t i = 0; i < 1000; ++i) {
      FoundLight found = Reported(FindLight(SkyAndSource, i));
      // The rest of the light is found by the other one.
      found.scattering_part = i % 10 == 0 ? 1 - c.scattering_part : c.scattering_part;
      statistics.Add(found);
    }
    const GuidingField next = Refine(field, statistics, 0);
    EXPECT_EQ(next.RegionAt({0, 0, 0})->share(), c.expected) << c.scattering_part;
  }
}

// Light that only the first iteration found is kept, as a part of all.
TEST(GuidingFieldTest, IterationsAreJoined) {
  const GuidingField field(BoxOf());
  GuidingSums sums;
  GuidingStatistics first(field, -20);
  for (int i = 0; i < 100; ++i) first.Add(Reported({0, 0, 0}, kSource, 1));
  const GuidingField after_first = Refine(field, first, 0, &sums);
  GuidingStatistics second(after_first, -20);
  for (int i = 0; i < 300; ++i) second.Add(Reported({0, 0, 0}, -kSource, 1));
  const GuidingField joined = Refine(after_first, second, 1, &sums);
  const GuidingField alone = Refine(after_first, second, 1);
  EXPECT_NEAR(joined.RegionAt({0, 0, 0})->ScatteredLight(), 1, 1e-6);
  int of_joined = 0, of_alone = 0;
  constexpr int kDraws = 1000;
  for (uint64_t n = 0; n < kDraws; ++n) {
    const std::array<float, 3> u = sheaf::testing::CounterUniforms(8, n);
    of_joined += Dot(joined.RegionAt({0, 0, 0})->Sample({u[0], u[1]}), kSource) > 0.8f;
    of_alone += Dot(alone.RegionAt({0, 0, 0})->Sample({u[0], u[1]}), kSource) > 0.8f;
  }
  EXPECT_NEAR(of_joined, 0.25 * kDraws, 50);
  EXPECT_LT(of_alone, 0.01 * kDraws);
}

TEST(GuidingFieldTest, UnlitRegionsHaveLearnedNothing) {
  const auto light = [](Vec3f p, Vec3f) { return p.y > 0 ? 1.0 : 0.0; };
  EXPECT_EQ(GuidingField(BoxOf()).RegionAt({0, 0, 0}), nullptr);
  const GuidingField field = Train(light, 2, 10000);
  EXPECT_NE(field.RegionAt({0.5f, 0.5f, 0.5f}), nullptr);
  EXPECT_EQ(field.RegionAt({0.5f, -0.5f, 0.5f}), nullptr);
  // Its halves neither; and it can learn again.
  const auto later = [](Vec3f p, Vec3f) { return p.y < 0 ? 1.0 : 0.0; };
  GuidingStatistics statistics(field, -20);
  for (uint64_t i = 0; i < 100000; ++i) {
    const Found found = FindLight(later, i);
    statistics.Add(Reported(found));
  }
  const GuidingField turned = Refine(field, statistics, 2);
  EXPECT_EQ(turned.RegionAt({0.5f, 0.5f, 0.5f}), nullptr);
  EXPECT_NE(turned.RegionAt({0.5f, -0.5f, 0.5f}), nullptr);
}

TEST(GuidingFieldTest, PointsOutsideBelongToTheNearestRegion) {
  const GuidingField field = Train(SkyAndSource, 3, 10000);
  const GuidingRegion* corner = field.RegionAt({1, 1, 1});
  EXPECT_EQ(field.RegionAt({2, 3, 1e30f}), corner);
  EXPECT_EQ(field.RegionAt({0.999f, std::numeric_limits<float>::infinity(), 1}), corner);
  EXPECT_NE(field.RegionAt({-5, 3, 1e30f}), corner);
  EXPECT_EQ(field.RegionAt({kNan, kNan, kNan}), field.RegionAt({-1, -1, -1}));
}

// Boxes without a volume still have regions; a side without a length is never halved.
TEST(GuidingFieldTest, FlatAndEmptyBoxesWork) {
  Bounds flat;
  flat.Add({0, 2, 0});
  flat.Add({4, 2, 1});
  for (const Bounds& box : {flat, Bounds()}) {
    const GuidingField field(box);
    GuidingStatistics statistics(field, 0);
    for (int i = 0; i < 10000; ++i) {
      const float x = static_cast<float>(i % 64) / 16;
      statistics.Add(Reported({x, 2, 0.5f * (x - std::floor(x))}, {0, 0, 1}, 1));
    }
    const GuidingField next = Refine(field, statistics, 0);
    EXPECT_NE(next.RegionAt({3, 2, 0.2f}), nullptr);
    if (!box.empty()) {
      EXPECT_EQ(next.RegionAt({3, 7, 0.2f}), next.RegionAt({3, -7, 0.2f}));
      EXPECT_NE(next.RegionAt({3, 2, 0.2f}), next.RegionAt({0.5f, 2, 0.2f}));
    }
  }
}

TEST(GuidingFieldTest, NeitherOrderNorThreadsMatter) {
  constexpr uint64_t kCount = 40000;
  const GuidingField field = Train(SkyAndSource, 1, 30000);
  const auto add = [](GuidingStatistics* statistics, uint64_t i) {
    const Found found = FindLight(SkyAndSource, i);
    statistics->Add(Reported(found));
  };
  GuidingStatistics forwards(field, -20), backwards(field, -20), threaded(field, -20);
  for (uint64_t i = 0; i < kCount; ++i) add(&forwards, i);
  for (uint64_t i = kCount; i-- > 0;) add(&backwards, i);
  std::vector<std::thread> threads;
  for (uint64_t t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (uint64_t i = t; i < kCount; i += 4) add(&threaded, i);
    });
  }
  for (std::thread& thread : threads) thread.join();
  const std::string expected = Refine(field, forwards, 1).Encode();
  EXPECT_EQ(Refine(field, backwards, 1).Encode(), expected);
  EXPECT_EQ(Refine(field, threaded, 1).Encode(), expected);
}

// Lengths and light that are scaled by powers of two.
TEST(GuidingFieldTest, ScalesChangeNoDecision) {
  constexpr float kLength = 0x1p-20f;
  constexpr double kLight = 0x1p20;
  GuidingField plain(BoxOf()), scaled(BoxOf(static_cast<double>(kLength)));
  for (int k = 0; k < 3; ++k) {
    GuidingStatistics of_plain(plain, -20), of_scaled(scaled, 0);
    for (uint64_t i = 0; i < 20000; ++i) {
      const Found found = FindLight(SkyAndSource, i);
      of_plain.Add(Reported(found));
      of_scaled.Add(Reported(found.p * kLength, found.w, found.value * kLight));
    }
    GuidingField next_plain = Refine(plain, of_plain, k);
    GuidingField next_scaled = Refine(scaled, of_scaled, k);
    plain = next_plain;
    scaled = next_scaled;
  }
  EXPECT_GT(plain.region_count(), 8u);
  EXPECT_EQ(plain.region_count(), scaled.region_count());
  for (uint64_t i = 0; i < 1000; ++i) {
    const Vec3f p = FindLight(SkyAndSource, i).p;
    const GuidingRegion *a = plain.RegionAt({p}), *b = scaled.RegionAt({p * kLength});
    ASSERT_NE(a, nullptr);
    ASSERT_NE(b, nullptr);
    const std::array<float, 3> u = sheaf::testing::CounterUniforms(4, i);
    const Vec3f w = a->Sample({u[0], u[1]});
    ASSERT_EQ(b->Sample({u[0], u[1]}), w);
    ASSERT_EQ(b->Pdf(w), a->Pdf(w));
    ASSERT_EQ(b->ScatteredLight(), a->ScatteredLight() * kLight);
  }
}

// The largest value that counts is 2^36 units. Here that is less than the other light of its
// region, so no more than half of the samples are drawn away from other directions.
TEST(GuidingFieldTest, FirefliesTakeABoundedPart) {
  const auto even = [](Vec3f, Vec3f) { return 0.1; };
  const GuidingField field(BoxOf());
  GuidingStatistics without(field, -20), with(field, -20);
  for (uint64_t i = 0; i < 100000; ++i) {
    const Found found = FindLight(even, i);
    without.Add(Reported(found));
    with.Add(Reported(found));
  }
  with.Add(Reported({0, 0, 0}, kSource, 1e30));
  with.Add(Reported({0, 0, 0}, kSource, kInf));
  with.Add(Reported({0, 0, 0}, kSource, static_cast<double>(kNan)));
  EXPECT_EQ(with.clamped(), 1u);
  EXPECT_EQ(with.non_finite(), 2u);
  EXPECT_EQ(without.clamped() + without.non_finite(), 0u);
  const GuidingField plain = Refine(field, without, 0), disturbed = Refine(field, with, 0);
  for (uint64_t i = 0; i < 10000; ++i) {
    const Found found = FindLight(even, i);
    if (Dot(found.w, kSource) > 0.7f) continue;
    const double before = PdfAt(*plain.RegionAt({found.p}), found.w);
    const double after = PdfAt(*disturbed.RegionAt({found.p}), found.w);
    ASSERT_GT(after, before / 2);
    ASSERT_LT(after, before * 1.3);  // By joined quads, whose light is averaged.
  }
  EXPECT_TRUE(std::isfinite(disturbed.RegionAt({0, 0, 0})->ScatteredLight()));
}

TEST(GuidingFieldTest, OneDirectionIsFoundToTheLimit) {
  GuidingField field(BoxOf());
  for (int k = 0; k < 4; ++k) {
    GuidingStatistics statistics(field, -20);
    for (int i = 0; i < 100; ++i) statistics.Add(Reported({0, 0, 0}, kSource, 1));
    GuidingField next = Refine(field, statistics, k);
    field = next;
  }
  const double largest = kUniform * std::ldexp(1.0, 2 * kGuidingQuadDepthMax);
  EXPECT_GT(PdfAt(*field.RegionAt({0, 0, 0}), kSource), 0.9 * largest);
  EXPECT_LE(PdfAt(*field.RegionAt({0, 0, 0}), kSource), largest);
}

// Few points, each with as many values as halve a region: the tree grows by the most that it can,
// down to each point, and each region wants as many quads as it can have.
TEST(GuidingFieldTest, LimitsAreKept) {
  constexpr uint64_t kPoints = 128;
  std::vector<Found> all;
  for (uint64_t i = 0; i < kPoints * 2001; ++i) {
    all.push_back(FindLight(SkyAndSource, i));
    all.back().p = all[i % kPoints].p;
  }
  GuidingField field(BoxOf());
  for (int k = 0; k < 8; ++k) {
    GuidingStatistics statistics(field, -20);
    for (const Found& found : all) statistics.Add(Reported(found));
    GuidingField next = Refine(field, statistics, 0);
    EXPECT_GE(next.region_count(), field.region_count());
    field = next;
  }
  EXPECT_LE(field.region_count(), kGuidingRegionsMax);
  EXPECT_GT(field.region_count(), kGuidingRegionsMax / 2);
  const std::string bytes = field.Encode();
  EXPECT_LE(bytes.size(), kGuidingDirectionsBytesMax);
  EXPECT_TRUE(GuidingField::Decode(bytes).ok());  // Checks the limits.
}

TEST(GuidingFieldTest, HalvingStopsAtTheGreatestDepth) {
  GuidingField field(BoxOf());
  for (int k = 0; k < 10; ++k) {
    GuidingStatistics statistics(field, -20);
    for (int i = 0; i < 2001; ++i) statistics.Add(Reported({0.3f, 0.3f, 0.3f}, kSource, 1));
    GuidingField next = Refine(field, statistics, 0);
    field = next;
  }
  EXPECT_EQ(field.region_count(), 1u + kGuidingSpaceDepthMax);
}

}  // namespace
}  // namespace sheaf::render
