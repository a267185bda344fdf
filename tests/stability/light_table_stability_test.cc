// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Rows L6 to L15 of the catalogue of hard cases, as far as these lights exist: environments, the
// choice of lights, and lights without emission; light_stability_test.cc has L1 to L5 and
// light_cluster_stability_test.cc L12. The tolerance of Monte Carlo comparisons is 6 standard
// errors (from 16 independent scrambles) plus the rounding of float samples.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "common/math/elementary.h"
#include "tests/support/hard_case.h"
#include "tests/support/light_tables.h"
#include "tests/support/naive_lights.h"
#include "tests/support/naive_sampling.h"
#include "tests/support/temporary_path.h"
#include "worker/render/light/environment_map.h"
#include "worker/render/light/shape_sampling.h"
#include "worker/render/sampling/equal_area_map.h"

namespace sheaf::render {
namespace {

using testing::Estimate;
using testing::EstimateIrradiance;
using testing::ExpectNear;
using testing::kOrigin;
using testing::kUp;
using testing::kWhite;
using testing::MakeDistant;
using testing::MakePoint;
using testing::MakeSky;
using testing::MakeTable;
using testing::RandomPoints;

// --- Groups of infinite lights

// Rays also leave scenes without infinite lights, in variants that support them. As many groups as
// their numbers have values: any entry that is read beyond the table's lights is one of them.
TEST(LightTableStabilityTest, NoInfiniteLightAddsToNoGroup) {
  std::vector<std::string> names;
  for (int i = 0; i <= std::numeric_limits<uint8_t>::max(); ++i) {
    names.push_back(std::to_string(1000 + i));
  }
  SceneDescription scene;
  scene.lights = {MakePoint(kWhite, {0, 0, 1})};
  scene.lights[0].group = names[7];
  const auto table = MakeTable({}, scene.lights);
  table->AssignGroups(scene, names);
  EXPECT_EQ(table->GroupOf(0), 7u);
  std::vector<Rgb> groups(names.size());
  table->AddByGroup(kOrigin, kUp, NoWavelengths{}, kWhite, kWhite, &groups);
  for (const Rgb& sum : groups) EXPECT_TRUE(sum.IsBlack());
}

// --- L6, L7: environments
// -------------------------------------------------------------------------

TEST(LightTableStabilityTest, L6OneTexelOfAMillion) {
  constexpr int kSize = 64;
  std::vector<Rgb> texels(kSize * kSize);
  // Where z > 0, away from the map's borders.
  constexpr int kX = 30, kY = 25;
  texels[kY * kSize + kX] = {1e6f, 1e6f, 1e6f};
  const auto map = EnvironmentMap::Make(kSize, texels);
  ASSERT_TRUE(map.ok());
  const Vec3d center = EqualAreaSquareToSphere({(kX + 0.5) / kSize, (kY + 0.5) / kSize});
  const double solid_angle = 4 * kPi / (kSize * kSize);
  double sum = 0, squares = 0;
  int even_hits = 0;
  constexpr int kEstimates = 4096, kPerEstimate = 64;
  for (uint64_t e = 0; e < kEstimates; ++e) {
    double value = 0;
    for (uint64_t i = 0; i < kPerEstimate; ++i) {
      const auto u = Sampler(3, static_cast<int32_t>(e), 0, i).Get4(1);
      even_hits +=
          e == 0 && static_cast<int>(u[0] * kSize) == kX && static_cast<int>(u[1] * kSize) == kY;
      const EnvironmentMap::PlaceSample sample = map->Sample({u[0], u[1]});
      const Vec3d d = map->Direction(sample.place);
      const Rgb radiance = map->Radiance(sample.place);
      ASSERT_GT(sample.pdf, 0);
      value += static_cast<double>(radiance.r) * d.z / double{sample.pdf} / kPerEstimate;
    }
    sum += value;
    squares += value * value;
  }
  const double mean = sum / kEstimates;
  const double relative_variance = squares / kEstimates / (mean * mean) - 1;
  EXPECT_LT(relative_variance, 0.1);
  // The cosine at the center replaces that over the texel's tent to second order.
  ExpectHardCase({.row = "L6",
                  .figure = "irradiance over that of a texel of 10^6",
                  .expected = 1,
                  .measured = mean / (1e6 * solid_angle * center.z),
                  .tolerance = 1e-3,
                  .naive = static_cast<float>(even_hits) / kPerEstimate * (kSize * kSize),
                  .naive_by = "64 directions spread evenly over the sphere"});
}

class EnvironmentFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    directory_ = sheaf::testing::TemporaryPath("lights");
    std::filesystem::create_directories(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  absl::StatusOr<std::unique_ptr<LightTable>> Build(
      int size, const std::vector<Rgb>& texels,
      const std::function<void(LightDescription*)>& change = {}, LightTableInput input = {}) {
    const std::string path = (directory_ / "sky.pfm").string();
    testing::WritePfm(path, size, texels);
    SceneDescription scene;
    scene.files = {"room.pbrt"};
    InfiniteLight infinite;
    infinite.file = "sky.pfm";
    LightDescription light;
    light.light = infinite;
    light.location = {0, 12, 3};
    if (change) change(&light);
    scene.lights = {light};
    TableFileSource files({{"sky.pfm", path}});
    return LightTable::Build(scene, std::move(input), files);
  }

  std::filesystem::path directory_;
};

using LightTableFileStabilityTest = EnvironmentFiles;

TEST_F(LightTableFileStabilityTest, L6MapsAreOrientedAsInPbrt) {
  // One bright texel in the middle of the second row of four: t = 3/8, s = 5/8, the quadrant of +x
  // -y.
  std::vector<Rgb> texels(16);
  texels[4 * 1 + 2] = kWhite;
  const auto table = Build(4, texels);
  ASSERT_TRUE(table.ok()) << table.status();
  const Vec3f d = ToFloat(EqualAreaSquareToSphere({0.625, 0.375}));
  EXPECT_GT(d.x, 0);
  EXPECT_LT(d.y, 0);
  EXPECT_GT(d.z, 0);
  EXPECT_NEAR((*table)->EnvironmentRadiance<kAllTraits>({}, d).r, 1, 1e-5);
  EXPECT_EQ((*table)->EnvironmentRadiance<kAllTraits>({}, -d).r, 0);
  // Rotated by a quarter turn about z: x becomes y.
  const auto turned = Build(4, texels, [](LightDescription* light) {
    light->world_from_light = RotateMatrix(90, {0, 0, 1});
  });
  ASSERT_TRUE(turned.ok());
  EXPECT_NEAR((*turned)->EnvironmentRadiance<kAllTraits>({}, {-d.y, d.x, d.z}).r, 1, 1e-5);
  RandomPoints random(5);
  for (int i = 0; i < 1000; ++i) {
    const auto sample = (*turned)->Sample<kAllTraits>(kOrigin, {}, 0, random.Next2());
    ASSERT_TRUE(sample.has_value());
    // The pdf is constant in squares. Rounding on the way over the sphere moves only a few points
    // in a million out of their square, and none of these.
    ASSERT_EQ(sample->pdf, (*turned)->PdfEnvironment<kAllTraits>(kOrigin, {}, sample->wi));
    const Rgb back = (*turned)->EnvironmentRadiance<kAllTraits>({}, sample->wi);
    for (size_t c = 0; c < 3; ++c) ASSERT_NEAR(sample->radiance[c], back[c], 4e-6);
  }
}

TEST_F(LightTableFileStabilityTest, L6OneByOneMapIsAConstantSky) {
  const auto table = Build(1, {kWhite});
  ASSERT_TRUE(table.ok()) << table.status();
  ExpectNear(EstimateIrradiance(**table, kOrigin, kUp), kPi);
}

TEST_F(LightTableFileStabilityTest, L6BadMapsAreNamedErrors) {
  std::vector<Rgb> texels(16, kWhite);
  texels[4 * 3 + 1].g = std::numeric_limits<float>::quiet_NaN();
  auto table = Build(4, texels);
  ASSERT_FALSE(table.ok());
  EXPECT_NE(table.status().message().find("room.pbrt:12:3"), std::string::npos) << table.status();
  EXPECT_NE(table.status().message().find("(1, 3)"), std::string::npos) << table.status();
  texels[4 * 3 + 1].g = -1;
  EXPECT_FALSE(Build(4, texels).ok());
  texels[4 * 3 + 1].g = 1;
  table = Build(4, texels, [](LightDescription* light) {
    light->world_from_light = ScaleMatrix({1, 2, 1});
  });
  EXPECT_TRUE(table.ok()) << table.status();
  table = Build(4, texels, [](LightDescription* light) {
    light->world_from_light = ScaleMatrix({0, 0, 0});
  });
  EXPECT_FALSE(table.ok());
}

TEST_F(LightTableFileStabilityTest, L6IlluminanceScalesTheMap) {
  const std::vector<Rgb> texels(64 * 64, Rgb{3, 3, 3});
  const auto table = Build(64, texels, [](LightDescription* light) {
    std::get<InfiniteLight>(light->light).illuminance_lx = 10;
  });
  ASSERT_TRUE(table.ok());
  // Twice the requested value: pbrt-v4's rule, which its scenes rely on.
  ExpectNear(EstimateIrradiance(**table, kOrigin, kUp), 20, 1e-3);
}

TEST_F(LightTableFileStabilityTest, L7BlackEnvironmentIsNoEnvironment) {
  LightTableInput input;
  input.spheres = {{{0, 0, 3}, 1, kWhite}};
  const auto with = Build(8, std::vector<Rgb>(64), {}, input);
  ASSERT_TRUE(with.ok());
  const auto without = MakeTable(input);
  RandomPoints random(71);
  for (int i = 0; i < 1000; ++i) {
    const float select = random.Next();
    const Vec2f u = random.Next2();
    const auto a = (*with)->Sample<kAllTraits>(kOrigin, kUp, select, u);
    const auto b = without->Sample<kAllTraits>(kOrigin, kUp, select, u);
    ASSERT_TRUE(a && b);
    ASSERT_EQ(a->wi, b->wi);
    ASSERT_EQ(a->pdf, b->pdf);
  }
  ExpectHardCase({.row = "L7",
                  .figure = "pdf of a black environment",
                  .expected = 0,
                  .measured = (*with)->PdfEnvironment<kAllTraits>(kOrigin, kUp, kUp),
                  .naive = naive::Fraction(0, 0),
                  .naive_by = "a texel over the sum of texels"});
  const auto only_black = Build(8, std::vector<Rgb>(64));
  ASSERT_TRUE(only_black.ok());
  EXPECT_TRUE((*only_black)->empty());
}

// --- L8, L9, L10: how many lights ----------------------------------------------------------------

TEST(LightTableStabilityTest, L8NoLightAndOneLight) {
  const auto none = MakeTable({});
  EXPECT_TRUE(none->empty());
  EXPECT_FALSE(none->Sample<kAllTraits>(kOrigin, kUp, 0.5f, {0.5f, 0.5f}));
  EXPECT_EQ(none->EnvironmentRadiance<kAllTraits>({}, kUp), Rgb{});
  LightTableInput input;
  input.spheres = {{{0, 0, 3}, 1, kWhite}};
  const auto one = MakeTable(input);
  for (float select : {0.0f, 0.5f, 0.99999994f}) {
    const auto sample = one->Sample<kAllTraits>(kOrigin, kUp, select, {0.3f, 0.6f});
    ASSERT_TRUE(sample.has_value());
    // Chosen with probability exactly 1.
    const auto alone = static_cast<float>(ViewSphere({0, 0, 3}, 1, false, kOrigin).pdf);
    ExpectHardCase({.row = "L8",
                    .figure = "probability of the only light",
                    .expected = 1,
                    .measured = sample->pdf / alone,
                    .naive = naive::Fraction(0, 0),
                    .naive_by = "importance over the sum, in a node of black lights"});
  }
}

TEST(LightTableStabilityTest, L9AMillionLightsAtOnePoint) {
  LightTableInput input;
  constexpr size_t kCount = 1000000;
  const TriangleEmitter t{{-0.5f, -0.5f, 2}, {0, 0.5f, 2}, {0.5f, -0.5f, 2}, Rgb::Gray(1e-6f)};
  input.triangles.assign(kCount, t);
  // many_lights_bench times it; if the split of equal lights were unbalanced, this would not
  // finish.
  const auto table = MakeTable(input);
  LightTableInput single;
  single.triangles = {t};
  single.triangles[0].radiance = kWhite;
  const Estimate all = EstimateIrradiance(*table, kOrigin, kUp);
  const Estimate one = EstimateIrradiance(*MakeTable(single), kOrigin, kUp);
  ExpectNear(all, one.mean, 1e-5);
  const float part = static_cast<float>(one.mean) * 1e-6f;
  ExpectHardCase({.row = "L10",
                  .figure = "irradiance of 10^6 lights",
                  .expected = one.mean,
                  .measured = all.mean,
                  .standard_error = all.standard_error,
                  .tolerance = 1e-5 * one.mean,
                  .naive = naive::Sum(std::vector<float>(kCount, part)),
                  .naive_by = "running sum of their parts"});
}

TEST(LightTableStabilityTest, L10ManyDifferentLightsAddUp) {
  // Above and below the number up to which lights are weighted individually.
  for (size_t count : {2u, 16u, 17u, 5000u}) {
    LightTableInput input;
    double expected = 0;
    std::vector<float> powers;
    RandomPoints random(count);
    for (size_t i = 0; i < count; ++i) {
      const double d = 5 + 20 * double{random.Next()}, tilt = 0.9 * double{random.Next()};
      const float radiance = 0.1f + random.Next();
      powers.push_back(radiance);
      input.spheres.push_back(
          {{d * tilt, 0, d * std::sqrt(1 - tilt * tilt)}, 0.5, Rgb{radiance, 1, 1}});
      expected += double{radiance} * kPi * 0.25 / (d * d) * std::sqrt(1 - tilt * tilt);
    }
    const Estimate estimate = EstimateIrradiance(*MakeTable(input), kOrigin, kUp, 16384);
    ExpectNear(estimate, expected, 1e-6);
    ExpectHardCase({.row = "L10",
                    .figure = "irradiance of " + InWords(count) + " lights",
                    .expected = expected,
                    .measured = estimate.mean,
                    .standard_error = estimate.standard_error,
                    .tolerance = 1e-6 * expected,
                    .naive = expected * naive::SumOfProbabilities(powers),
                    .naive_by = "times the sum of their float probabilities"});
  }
}

TEST(LightTableStabilityTest, L10InfiniteAndLocalLightsTogether) {
  LightTableInput input;
  for (int i = 0; i < 40; ++i) {
    input.spheres.push_back({{0, 0, 10.0 + i}, 1, Rgb::Gray(100)});
  }
  double expected = kPi * 0.01 + 0.5;
  for (int i = 0; i < 40; ++i) expected += 100 * kPi / ((10.0 + i) * (10.0 + i));
  const auto table = MakeTable(
      input, {MakeSky({0.01f, 0.01f, 0.01f}), MakeDistant({0.5f, 0.5f, 0.5f}, {0, 0, 1})});
  ExpectNear(EstimateIrradiance(*table, kOrigin, kUp, 16384), expected);
}

// --- L11 to L15 --------------------------------------------------------------------------------

TEST(LightTableStabilityTest, L11NegativeLightsCancelAndBlackOnesAreNotChosen) {
  LightTableInput input;
  input.spheres = {{{0, 0, 3}, 1, kWhite}, {{0, 0, 3}, 1, Rgb::Gray(-1)}};
  const Estimate estimate = EstimateIrradiance(*MakeTable(input), kOrigin, kUp, 4096);
  ExpectHardCase({.row = "L11",
                  .figure = "irradiance of a light and its negative",
                  .expected = 0,
                  .measured = estimate.mean,
                  .standard_error = estimate.standard_error,
                  .tolerance = 1e-7,
                  .naive = naive::LightOfPositive({1, -1}) * naive::SphereSolidAngle(1, 3),
                  .naive_by = "lights of no positive power dropped"});
  input.spheres[1].radiance = {};
  const auto table = MakeTable(input);
  for (float select : {0.0f, 0.3f, 0.7f, 0.99999994f}) {
    ASSERT_TRUE(table->Sample<kAllTraits>(kOrigin, kUp, select, {0.5f, 0.5f}));
  }
  EXPECT_EQ(table->PdfEmitter<kAllTraits>(1, kOrigin, kUp, kUp, {0, 0, 2}), 0);
}

TEST(LightTableStabilityTest, L14LightsWithoutSizeAreNoLights) {
  LightTableInput input;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  input.triangles = {{{1, 1, 1}, {1, 1, 1}, {1, 1, 1}, kWhite},
                     {{0, 0, 1}, {1, 0, 1}, {2, 0, 1}, kWhite, true},
                     {{nan, 0, 1}, {1, 0, 1}, {0, 1, 1}, kWhite, true},
                     {{0, 0, 1}, {1, 0, 1}, {0, 1, 1}, Rgb{nan, 1, 1}, true}};
  input.spheres = {{{0, 0, 3}, 0, kWhite}};
  input.disks = {{{0, 0, 3}, {0, 0, -1}, {1, 0, 0}, 0, 0, kWhite},
                 {{0, 0, 3}, {0, 0, -1}, {1, 0, 0}, 1, 1, kWhite}};
  const auto table = MakeTable(input);
  EXPECT_TRUE(table->empty());
  // Together with a valid light, only that one is chosen, and the pdf of the others is 0.
  input.spheres.push_back({{0, 0, 5}, 1, kWhite});
  const auto with_sphere = MakeTable(input);
  ExpectNear(EstimateIrradiance(*with_sphere, kOrigin, kUp), kPi / 25);
  for (uint32_t emitter : {0u, 1u, 2u, 3u, 4u, 6u, 7u}) {
    ExpectHardCase(
        {.row = "L14",
         .figure = "pdf of lights without size",
         .expected = 0,
         .measured = with_sphere->PdfEmitter<kAllTraits>(emitter, kOrigin, kUp, kUp, {0, 0, 1}),
         .naive = naive::Fraction(1, 0),
         .naive_by = "1 / area"});
  }
}

TEST(LightTableStabilityTest, L15DistantLightGivesItsIlluminance) {
  const auto table = MakeTable({}, {MakeDistant(kWhite, {0, 3, 4})});
  const auto sample = table->Sample<kAllTraits>({7, 8, 9}, kUp, 0.5f, {0.5f, 0.5f});
  ASSERT_TRUE(sample.has_value());
  EXPECT_TRUE(sample->is_delta && sample->is_infinite);
  EXPECT_NEAR(sample->wi.y, 0.6, 1e-7);
  EXPECT_NEAR(sample->wi.z, 0.8, 1e-7);
  EXPECT_EQ(sample->radiance, kWhite);
  EXPECT_EQ(sample->pdf, 1);
}

TEST(LightTableStabilityTest, InvalidLightsAreNamedErrors) {
  LightDescription spot = testing::MakeSpot(kWhite, {1, 2, 3}, {1, 2, 3}, 30, 5);
  LightDescription distant = MakeDistant(kWhite, {0, 0, 0});
  LightDescription flat = testing::MakeSpot(kWhite, {0, 0, 0}, {0, 0, 1}, 30, 5);
  flat.world_from_light = ScaleMatrix({1, 0, 1});
  LightDescription endless = MakePoint({std::numeric_limits<float>::infinity(), 1, 1}, {0, 0, 0});
  for (LightDescription light : {spot, distant, flat, endless}) {
    light.location = {0, 7, 1};
    SceneDescription scene;
    scene.files = {"room.pbrt"};
    scene.lights = {light};
    TableFileSource files(std::map<std::string, std::string>{});
    const auto table = LightTable::Build(scene, {}, files);
    ASSERT_FALSE(table.ok());
    EXPECT_EQ(table.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_NE(table.status().message().find("room.pbrt:7:1: "), std::string::npos)
        << table.status();
  }
}

// The sun as a disk of half a degree and less, a distant sphere: the same flux however small it is.
TEST(LightTableStabilityTest, L15TinySunKeepsItsFlux) {
  for (double degrees : {0.53, 0.1, 1e-2, 1e-3, 1e-4}) {
    const double sine = std::sin(0.5 * degrees * kPi / 180), d = 1e6;
    LightTableInput input;
    const float radiance = static_cast<float>(1 / (kPi * sine * sine));
    input.spheres = {{{0, 0, d}, d * sine, Rgb::Gray(radiance)}};
    const Estimate estimate = EstimateIrradiance(*MakeTable(input), kOrigin, kUp);
    ExpectNear(estimate, 1, 1e-6);
    ExpectHardCase({.row = "L15",
                    .figure = "irradiance of a sun of 1e-4 degrees",
                    .expected = 1,
                    .measured = estimate.mean,
                    .standard_error = estimate.standard_error,
                    .tolerance = 1e-6,
                    .naive = radiance * naive::SphereSolidAngle(static_cast<float>(sine), 1),
                    .naive_by = "solid angle as 2 pi (1 - cos)"});
  }
}

TEST(LightTableStabilityTest, NonFiniteReceiversFindNoLight) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  LightTableInput input;
  input.triangles = {{{0, 0, 1}, {0, 1, 1}, {1, 0, 1}, kWhite, true}};
  input.spheres = {{{0, 0, 3}, 1, kWhite, true}};
  input.disks = {{{0, 0, 3}, {0, 0, -1}, {1, 0, 0}, 1, 0, kWhite, true}};
  const auto table = MakeTable(input, {MakePoint(kWhite, {0, 0, 2})});
  RandomPoints random(9);
  for (const Vec3f& p :
       {Vec3f{nan, 0, 0}, Vec3f{0, inf, 0}, Vec3f{-inf, nan, inf}, Vec3f{3e38f, 3e38f, 0}}) {
    for (int i = 0; i < 100; ++i) {
      const auto sample = table->Sample<kAllTraits>(p, kUp, random.Next(), random.Next2());
      if (!sample) continue;
      EXPECT_TRUE(std::isfinite(sample->pdf) && IsFinite(sample->radiance));
    }
  }
}

}  // namespace
}  // namespace sheaf::render
