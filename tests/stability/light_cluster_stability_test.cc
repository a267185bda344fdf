// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Row L12 of the catalogue of hard cases: lights seen edge-on or across the horizon, among others,
// are neither lost nor counted wrongly.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "tests/support/light_tables.h"
#include "tests/support/long_tests.h"
#include "worker/render/light/shape_sampling.h"
#include "worker/render/sampling/equal_area_map.h"

namespace sheaf::render {
namespace {

using testing::Estimate;
using testing::EstimateIrradiance;
using testing::EstimateMean;
using testing::kWhite;
using testing::MakeTable;
using testing::RandomPoints;

// Triangle lights in a cube of the given side about the origin.
LightTableInput RandomCluster(size_t count, float scale, RandomPoints* random) {
  const auto vector = [&] {
    return Vec3f{random->Next() - 0.5f, random->Next() - 0.5f, random->Next() - 0.5f} * scale;
  };
  LightTableInput input;
  for (size_t i = 0; i < count; ++i)
    input.triangles.push_back({vector(), vector(), vector(), kWhite});
  return input;
}
Vec3d NormalOf(const TriangleEmitter& t) {
  return Cross(ToDouble(t.v1) - ToDouble(t.v0), ToDouble(t.v2) - ToDouble(t.v0));
}

// Expected by the catalogue: in random clusters, every light with an unoccluded contribution can be
// chosen (10^8 pairs). Receivers are just in front of a light's plane, often beside the light, so
// that it is seen almost edge-on; their horizons pass through the cluster.
TEST(LightClusterStability, L12EveryContributingLightCanBeChosen) {
  const int pair_count = DrawCount(300000, 100000000);
  constexpr int kReceivers = 32;
  RandomPoints random(12);
  int pairs = 0, never_chosen = 0;
  while (pairs < pair_count) {
    const auto count = static_cast<size_t>(2 * std::pow(16.f, random.Next()));
    const float scale = std::pow(10.f, 6 * random.Next() - 3);
    const LightTableInput input = RandomCluster(count, scale, &random);
    const auto table = MakeTable(input);
    for (int r = 0; r < kReceivers; ++r) {
      const TriangleEmitter& t = input.triangles[static_cast<size_t>(r) % count];
      const Vec3d normal = NormalOf(t);
      if (!(Length(normal) > 1e-12 * double{scale * scale})) continue;
      const Vec3f side = t.v1 - t.v0 + (t.v2 - t.v0);
      const Vec3f p =
          t.v0 + side * (4 * random.Next() - 2) +
          ToFloat(Normalize(normal) * double{scale} * std::pow(10.0, -6.0 * double{random.Next()}));
      const Vec3f n = ToFloat(EqualAreaSquareToSphere({random.Next(), random.Next()}));
      for (uint32_t i = 0; i < count; ++i) {
        const TriangleEmitter& light = input.triangles[i];
        const TriangleView view = ViewTriangle(light.v0, light.v1, light.v2, p);
        if (!view.visible || !view.front()) continue;
        const Vec3f corners[3] = {light.v0, light.v1, light.v2};
        const Vec3f highest = *std::max_element(
            corners, corners + 3, [n](Vec3f a, Vec3f b) { return Dot(a, n) < Dot(b, n); });
        const bool is_up = Dot(ToDouble(highest) - ToDouble(p), ToDouble(n)) > 0;
        ++pairs;
        const Vec3f wi = Normalize(highest - p);
        never_chosen +=
            !(table->PdfEmitter<kAllTraits>(i, p, is_up ? n : Vec3f{}, wi, highest) > 0);
      }
    }
  }
  EXPECT_EQ(never_chosen, 0);
}

// Expected by the catalogue: the irradiance of a cluster equals that of uniform sampling of lights
// and points (Welch's test; at 30 degrees of freedom and 5 standard errors a correct table fails
// once in 40000).
TEST(LightClusterStability, L12ClustersMatchUniformChoice) {
  const int cluster_count = DrawCount(24, 400);
  RandomPoints random(13);
  int failures = 0;
  for (int c = 0; c < cluster_count; ++c) {
    const auto count = static_cast<size_t>(2 * std::pow(32.f, random.Next()));
    const LightTableInput input = RandomCluster(count, 1, &random);
    const Vec3f p = ToFloat(EqualAreaSquareToSphere({random.Next(), random.Next()}) * 1.3);
    const Vec3f n = ToFloat(EqualAreaSquareToSphere({random.Next(), random.Next()}));
    const Estimate table = EstimateIrradiance(*MakeTable(input), p, n, 2048);
    const Estimate even = EstimateMean(8192, [&](const std::array<float, 4>& u) {
      const auto chosen = static_cast<size_t>(u[0] * static_cast<float>(count));
      const TriangleEmitter& t = input.triangles[chosen];
      const double root = std::sqrt(double{u[1]});
      const Vec3d x = ToDouble(t.v0) * (1 - root) + ToDouble(t.v1) * (root * (1 - double{u[2]})) +
                      ToDouble(t.v2) * (root * double{u[2]});
      const Vec3d way = x - ToDouble(p), normal = NormalOf(t);
      const double square = LengthSquared(way);
      const double cosines =
          std::max(0.0, Dot(way, ToDouble(n))) * std::max(0.0, -Dot(way, normal));
      return 0.5 * cosines / (square * square) * static_cast<double>(count);
    });
    failures += std::fabs(table.mean - even.mean) >
                5 * std::hypot(table.standard_error, even.standard_error) + 1e-6 * even.mean;
  }
  EXPECT_EQ(failures, 0);
}

}  // namespace
}  // namespace sheaf::render
