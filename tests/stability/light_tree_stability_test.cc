// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Rows L8 to L13 of the catalogue of hard cases, as far as they concern the light tree;
// light_table_stability_test.cc has the others. The tolerance of Monte Carlo comparisons is 6
// standard errors (from 16 independent scrambles) plus the rounding of float samples.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "common/math/elementary.h"
#include "tests/support/chi_square.h"
#include "tests/support/hard_case.h"
#include "tests/support/light_tables.h"
#include "tests/support/naive_lights.h"
#include "worker/render/light/choice/light_choice.h"
#include "worker/render/light/choice/light_tree.h"
#include "worker/render/light/shape_sampling.h"

namespace sheaf::render {
namespace {

using testing::Estimate;
using testing::EstimateIrradiance;
using testing::MakeTable;
using testing::RandomPoints;

const Rgb kTreeWhite{1, 1, 1};
constexpr Vec3f kTreeOrigin{0, 0, 0};
constexpr Vec3f kTreeUp{0, 0, 1};

Vec3f RandomVector(RandomPoints* random, float size) {
  const float x = random->Next(), y = random->Next(), z = random->Next();
  return Vec3f{2 * x - 1, 2 * y - 1, 2 * z - 1} * size;
}
Vec3f RandomDirection(RandomPoints* random) {
  for (;;) {
    const Vec3f v = RandomVector(random, 1);
    if (LengthSquared(v) > 1e-3f) return Normalize(v);
  }
}

LightBounds Panel(Vec3f center, Vec3f normal, float radius, bool two_sided) {
  return {.kind = LightBounds::Kind::kPlanar,
          .two_sided = two_sided,
          .center = center,
          .normal = normal,
          .radius = radius,
          .area = radius * radius,
          .strength = 1};
}

LightBounds BoundsOf(const TriangleEmitter& t) {
  const Vec3d v0 = ToDouble(t.v0), e1 = ToDouble(t.v1) - v0, e2 = ToDouble(t.v2) - v0;
  const Vec3d normal = Cross(e1, e2), center = v0 + (e1 + e2) / 3.0;
  const double radius =
      std::max({Length(v0 - center), Length(v0 + e1 - center), Length(v0 + e2 - center)});
  LightBounds bounds =
      Panel(ToFloat(center), ToFloat(Normalize(normal)), static_cast<float>(radius), t.two_sided);
  bounds.area = static_cast<float>(0.5 * Length(normal));
  return bounds;
}

// Whether some point of the triangle's front is visible from p above the horizon of n.
bool Emits(const TriangleEmitter& t, Vec3f p, Vec3f n) {
  const TriangleView view = ViewTriangle(t.v0, t.v1, t.v2, p);
  if (!view.visible || !(view.front() || t.two_sided)) return false;
  if (n == Vec3f{}) return true;
  for (const Vec3f& v : {t.v0, t.v1, t.v2}) {
    if (Dot(ToDouble(v) - ToDouble(p), ToDouble(n)) > 0) return true;
  }
  return false;
}

// --- L8: none and one ----------------------------------------------------------------------------

TEST(LightTreeStabilityTest, L8OneLightAmongBlackOnesIsSampledAsIfAlone) {
  LightTableInput one, many;
  one.spheres = {{{1, 0, 3}, 0.5, kTreeWhite}};
  many.spheres.assign(50, {{0, 0, 2}, 1, {}});
  many.spheres[31] = one.spheres[0];
  const auto alone = MakeTable(one), among = MakeTable(many);
  RandomPoints random(8);
  for (int i = 0; i < 1000; ++i) {
    const float select = random.Next();
    const Vec2f u = random.Next2();
    const auto a = alone->Sample<kAllTraits>(kTreeOrigin, kTreeUp, select, u);
    const auto b = among->Sample<kAllTraits>(kTreeOrigin, kTreeUp, select, u);
    ASSERT_TRUE(a && b);
    ASSERT_EQ(a->wi, b->wi);
    ASSERT_EQ(a->pdf, b->pdf);
  }
  many.spheres[31].radiance = {};
  EXPECT_TRUE(MakeTable(many)->empty());
}

// --- L9, L10: how many
// -----------------------------------------------------------------------------

TEST(LightTreeStabilityTest, L9CoincidentLightsMakeAShallowTree) {
  for (bool points : {false, true}) {
    LightBounds light = Panel({3, 4, 5}, {0, 0, 1}, 0.5f, true);
    if (points) {
      light.kind = LightBounds::Kind::kPoint;
      light.radius = light.area = 0;
    }
    const LightTree tree(std::vector<LightBounds>(1000000, light));
    EXPECT_LE(tree.depth(), 10);
    EXPECT_LE(tree.size_bytes(), 100u * 1000000);
    for (uint32_t i : {0u, 1u, 499999u, 999999u}) {
      for (const Vec3f& p : {kTreeOrigin, light.center}) {
        ExpectHardCase(
            {.row = "L9",
             .figure = "probability of one of 10^6 lights at one point",
             .expected = 1e-6,
             .measured = tree.Probability(i, p, {}),
             .tolerance = 1e-10,
             .naive = naive::PlaceInBounds(light.center.x, light.center.x, light.center.x),
             .naive_by = "place in the bounds of all, for a split"});
      }
    }
  }
}

// Each light is twice as close to a point as the one before: no plane splits such lights evenly.
TEST(LightTreeStabilityTest, L9CrowdedLightsMakeATreeOfBoundedDepth) {
  std::vector<LightBounds> lights;
  for (int i = 0; i < 1000; ++i) {
    lights.push_back(
        Panel({std::ldexp(1.0f, -i / 8), 0, 0}, kTreeUp, std::ldexp(0.1f, -i / 8), true));
  }
  const LightTree tree(lights);
  EXPECT_LE(tree.depth(), LightTree::kDepthMax);
  double sum = 0;
  for (uint32_t i = 0; i < lights.size(); ++i) {
    sum += static_cast<double>(tree.Probability(i, {0, 0, 1}, {}));
  }
  EXPECT_NEAR(sum, 1, 1e-5);
}

TEST(LightTreeStabilityTest, L10ChoiceAmongManyPassesChiSquare) {
  constexpr size_t kCount = 1 << 15;
  constexpr int kDraws = 150000;
  constexpr int kPoints = 3;
  RandomPoints random(10);
  std::vector<LightBounds> lights;
  for (size_t i = 0; i < kCount; ++i) {
    lights.push_back(Panel(RandomVector(&random, 10), RandomDirection(&random), 0.01f, i % 3 == 0));
    lights.back().strength = std::pow(10.0f, 4 * random.Next());
  }
  const LightChoice choice(lights);
  for (int k = 0; k < kPoints; ++k) {
    const Vec3f p = RandomVector(&random, 5);
    const Vec3f n = k == 0 ? Vec3f{} : RandomDirection(&random);
    std::vector<int> counts(kCount);
    for (int i = 0; i < kDraws; ++i) {
      const auto u = sheaf::testing::CounterUniforms(77, static_cast<uint64_t>(i + k * kDraws));
      const auto chosen = choice.Choose(p, n, u[0], SaltOf({u[1], u[2]}));
      ASSERT_TRUE(chosen.has_value());
      ASSERT_EQ(chosen->probability, choice.Probability(chosen->light, p, n));
      ++counts[chosen->light];
    }
    // Lights in order are pooled until their expected number of draws is 20.
    double statistic = 0, expected = 0, sum = 0;
    int observed = 0, cells = 0;
    for (uint32_t i = 0; i < kCount; ++i) {
      const double probability = static_cast<double>(choice.Probability(i, p, n));
      sum += probability;
      expected += probability * kDraws;
      observed += counts[i];
      if (expected < 20 && i + 1 < kCount) continue;
      if (expected > 0) statistic += (observed - expected) * (observed - expected) / expected;
      expected = 0;
      observed = 0;
      ++cells;
    }
    EXPECT_NEAR(sum, 1, 1e-4);
    ASSERT_GT(cells, 1000);
    EXPECT_GT(sheaf::testing::UpperGammaQ(0.5 * (cells - 1), 0.5 * statistic),
              sheaf::testing::SidakThreshold(0.01, kPoints));
  }
}

// --- L12: no contributing light is omitted -------------------------------------------------------

// Clusters of all shapes and sizes, with points beside, between and just in front of their lights.
// If one light of a cluster illuminates the point, the cluster's bounds must say so. The bounds are
// tested directly, since the fraction of choices that ignores them would hide an error.
TEST(LightTreeStabilityTest, L12BoundsOfClustersLoseNoLight) {
  RandomPoints random(12);
  int grazing = 0, lost = 0, lost_by_center = 0;
  for (int i = 0; i < 4000; ++i) {
    const float scale = std::pow(10.0f, 6 * random.Next() - 3);
    const Vec3f middle = RandomVector(&random, 100 * scale * random.Next());
    const Vec3f facing = RandomDirection(&random);
    const float spread = random.Next();
    const size_t count = 1 + static_cast<size_t>(40 * random.Next() * random.Next());
    std::vector<TriangleEmitter> triangles;
    std::vector<LightBounds> bounds;
    while (triangles.size() < count) {
      const Vec3f v0 = middle + RandomVector(&random, scale);
      const float size = scale * std::pow(10.0f, -2 * random.Next());
      // Edges perpendicular to a normal that deviates from the cluster's.
      const Vec3f normal = Normalize(facing + RandomVector(&random, spread + 1e-3f));
      Vec3f v1 = v0 + Cross(normal, RandomVector(&random, size));
      Vec3f v2 = v0 + Cross(normal, RandomVector(&random, size));
      const Vec3d cross = Cross(ToDouble(v1 - v0), ToDouble(v2 - v0));
      if (!(Length(cross) > 1e-6 * double{size * size})) continue;
      if (Dot(cross, ToDouble(normal)) < 0) std::swap(v1, v2);
      triangles.push_back({v0, v1, v2, kTreeWhite, random.Next() < 0.1f});
      bounds.push_back(BoundsOf(triangles.back()));
    }
    const LightTree tree(bounds);
    for (int k = 0; k < 25; ++k) {
      Vec3f p = middle + RandomVector(&random, scale * std::pow(10.0f, 2 * random.Next() - 1));
      if (k % 2 == 0) {
        // Just in front of a light's plane.
        const size_t at = static_cast<size_t>(k) % count;
        const Vec3f across = Cross(bounds[at].normal, RandomVector(&random, 3 * scale));
        const float height = scale * std::pow(10.0f, -7 * random.Next());
        p = bounds[at].center + across + bounds[at].normal * height;
      }
      Vec3f n{};
      if (k % 3 == 0) n = RandomDirection(&random);
      if (k % 3 == 1) {
        // The cluster just above the horizon.
        n = Cross(RandomDirection(&random), triangles[0].v0 - p);
        n = LengthSquared(n) > 0 ? Normalize(n) : Vec3f{};
      }
      bool emits = false;
      for (const TriangleEmitter& t : triangles) emits |= Emits(t, p, n);
      if (!emits) continue;
      ++grazing;
      EXPECT_GT(tree.Irradiance(p, n), 0) << i << " " << k;
      lost += !(tree.Irradiance(p, n) > 0);
      lost_by_center += !(naive::CenterImportance(middle, facing, p, n) > 0);
    }
  }
  EXPECT_GT(grazing, 30000);
  ExpectHardCase({.row = "L12",
                  .figure = "lit points for which a cluster says that it is dark",
                  .expected = 0,
                  .measured = lost,
                  .naive = lost_by_center,
                  .naive_by = "cosines at the cluster's center and mean normal"});
}

// Inner nodes, too: if a light contributes a considerable fraction, walks by the estimates reach
// it, and not only walks by intensity.
TEST(LightTreeStabilityTest, L12WalksReachContributingLights) {
  RandomPoints random(121);
  for (int i = 0; i < 30; ++i) {
    std::vector<TriangleEmitter> triangles;
    std::vector<LightBounds> bounds;
    double total = 0;
    for (int k = 0; k < 1000; ++k) {
      const Vec3f v0 = RandomVector(&random, 1);
      triangles.push_back({v0, v0 + RandomVector(&random, 0.1f), v0 + RandomVector(&random, 0.1f),
                           kTreeWhite, k % 7 == 0});
      bounds.push_back(BoundsOf(triangles.back()));
      total += static_cast<double>(bounds.back().area);
    }
    const LightTree tree(bounds);
    const Vec3f p = RandomVector(&random, 1.5f), n = RandomDirection(&random);
    for (uint32_t k = 0; k < triangles.size(); ++k) {
      const TriangleView view = ViewTriangle(triangles[k].v0, triangles[k].v1, triangles[k].v2, p);
      if (!Emits(triangles[k], p, n) || view.solid_angle < 1e-3) continue;
      const double by_intensity =
          LightTree::kIntensityProbability * static_cast<double>(bounds[k].area) / total;
      ASSERT_GT(static_cast<double>(tree.Probability(k, p, n)), 1.001 * by_intensity);
    }
  }
}

TEST(LightTreeStabilityTest, L12ManyTrianglesGiveTheSumOfEach) {
  RandomPoints random(122);
  LightTableInput input;
  for (int i = 0; i < 600; ++i) {
    const Vec3f v0 = RandomVector(&random, 1);
    const float radiance = std::pow(10.0f, 2 * random.Next());
    input.triangles.push_back({v0, v0 + RandomVector(&random, 0.2f),
                               v0 + RandomVector(&random, 0.2f), Rgb::Gray(radiance), i % 5 == 0});
  }
  const auto table = MakeTable(input);
  for (const Vec3f& p : {Vec3f{0.1f, 0.2f, -0.1f}, Vec3f{3, 0, -1}, Vec3f{0, 0, -30}}) {
    double expected = 0;
    for (const TriangleEmitter& t : input.triangles) {
      LightTableInput single;
      single.triangles = {t};
      expected += EstimateIrradiance(*MakeTable(single), p, kTreeUp, 64).mean;
    }
    const Estimate estimate = EstimateIrradiance(*table, p, kTreeUp, 16384);
    EXPECT_NEAR(estimate.mean, expected, 6 * estimate.standard_error + 1e-3 * expected);
  }
}

// --- L11: negative and black lights among many
// -----------------------------------------------------

// At the position of every light there is one of equal strength and opposite sign, or a black one.
TEST(LightTreeStabilityTest, L11NegativeLightsCancelInTheHierarchyAndBlackOnesAreNotChosen) {
  LightTableInput input;
  RandomPoints random(11);
  for (int i = 0; i < 300; ++i) {
    const Vec3f center = RandomVector(&random, 2) + Vec3f{0, 0, 3};
    const float radiance = i % 3 == 2 ? 0 : (i % 3 == 0 ? 1.0f : -1.0f);
    const Vec3f at = i % 3 == 0 ? center : ToFloat(input.spheres.back().center);
    input.spheres.push_back({ToDouble(at), 0.1, Rgb::Gray(radiance)});
  }
  const auto table = MakeTable(input);
  const Estimate estimate = EstimateIrradiance(*table, kTreeOrigin, kTreeUp, 4096);
  EXPECT_GT(estimate.standard_error, 0);
  EXPECT_NEAR(estimate.mean, 0, 6 * estimate.standard_error);
  for (uint32_t emitter = 0; emitter < 300; ++emitter) {
    const Vec3f to_light = ToFloat(input.spheres[emitter].center);
    const float pdf = table->PdfEmitter<kAllTraits>(emitter, kTreeOrigin, {}, Normalize(to_light),
                                                    to_light * (1 - 0.1f / Length(to_light)));
    EXPECT_EQ(pdf > 0, emitter % 3 != 2) << emitter;
  }
}

// --- L13: cones that have no axis ----------------------------------------------------------------

TEST(LightTreeStabilityTest, L13CancelingNormalsMakeAFullCone) {
  // One-sided lights back to back, for every number of pairs: the mean normal is 0.
  for (size_t pairs : {1u, 4u, 5u, 40u}) {
    std::vector<LightBounds> lights;
    for (size_t i = 0; i < pairs; ++i) {
      lights.push_back(Panel({0, 0, 0}, {0, 0, 1}, 0.5f, false));
      lights.push_back(Panel({0, 0, 0}, {0, 0, -1}, 0.5f, false));
    }
    const LightTree tree(lights);
    for (const Vec3f& p : {Vec3f{0, 0, 3}, Vec3f{0, 0, -3}, Vec3f{5, 0, 0.01f}, Vec3f{}}) {
      EXPECT_GT(tree.Irradiance(p, {}), 0);
      double sum = 0, facing = 0;
      for (uint32_t i = 0; i < lights.size(); ++i) {
        const double probability = static_cast<double>(tree.Probability(i, p, {}));
        ASSERT_TRUE(std::isfinite(probability));
        sum += probability;
        if (lights[i].normal.z * p.z > 0) facing += probability;
      }
      ExpectHardCase({.row = "L13",
                      .figure = "sum of probabilities in a cluster whose normals cancel",
                      .expected = 1,
                      .measured = sum,
                      .tolerance = 1e-5,
                      .naive = naive::Fraction(0, Length(Vec3f{0, 0, 1} + Vec3f{0, 0, -1})),
                      .naive_by = "mean axis over its length: its x"});
      // If there is a front side, the estimates are directed there.
      if (std::fabs(p.z) > 1) {
        EXPECT_GT(facing, 0.9);
      }
    }
  }
}

}  // namespace
}  // namespace sheaf::render
