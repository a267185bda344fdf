// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Light tables made from emitters only, points to sample them with, and estimates with error bars,
// for tests of lights.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "common/base/check.h"
#include "common/film/film_tile.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "gtest/gtest.h"
#include "worker/render/bsdf/bsdf.h"
#include "worker/render/light/light_table.h"
#include "worker/render/sampling/sampler.h"

namespace sheaf::render::testing {

inline constexpr Rgb kWhite{1, 1, 1};
inline constexpr Vec3f kOrigin{0, 0, 0};
inline constexpr Vec3f kUp{0, 0, 1};

inline std::unique_ptr<LightTable> MakeTable(LightTableInput input,
                                             std::vector<LightDescription> lights = {}) {
  SceneDescription scene;
  scene.lights = std::move(lights);
  TableFileSource files({});
  auto table = LightTable::Build(scene, std::move(input), files);
  SHEAF_CHECK(table.ok());
  return std::move(*table);
}

inline ColorSpec ColorOf(Rgb rgb) {
  ColorSpec color;
  color.rgb = rgb;
  return color;
}
inline LightDescription MakeSky(Rgb radiance) {
  InfiniteLight infinite;
  infinite.radiance = ColorOf(radiance);
  LightDescription light;
  light.light = infinite;
  return light;
}
inline LightDescription MakePoint(Rgb intensity, Vec3d from) {
  LightDescription light;
  light.light = PointLight{ColorOf(intensity), from};
  return light;
}
inline LightDescription MakeDistant(Rgb radiance, Vec3d from) {
  LightDescription light;
  light.light = DistantLight{ColorOf(radiance), from, {0, 0, 0}, -1};
  return light;
}
inline LightDescription MakeSpot(Rgb intensity, Vec3d from, Vec3d to, float cone_degrees,
                                 float delta_degrees) {
  LightDescription light;
  light.light = SpotLight{ColorOf(intensity), from, to, cone_degrees, delta_degrees};
  return light;
}

// Uniform multiples of 2^-24, as the sampler makes them, from a seed chosen by the test.
class RandomPoints {
 public:
  explicit RandomPoints(uint64_t seed) : engine_(seed) {}
  float Next() { return static_cast<float>(engine_() >> 40) * 0x1p-24f; }
  Vec2f Next2() {
    const float x = Next();
    return {x, Next()};
  }

 private:
  std::mt19937_64 engine_;
};

struct Estimate {
  double mean = 0;
  double standard_error = 0;  // The mean's, from kReplicateCount independent scrambles.
};
// Mean of f over scrambled points, points_per_replicate (a power of two) from each replicate.
inline Estimate EstimateMean(uint64_t points_per_replicate,
                             const std::function<double(const std::array<float, 4>&)>& f) {
  std::array<double, kReplicateCount> sum{};
  for (uint64_t i = 0; i < points_per_replicate * kReplicateCount; ++i) {
    sum[ReplicateOf(i)] += f(Sampler(20260701, 3, 5, i).Get4(1));
  }
  Estimate estimate;
  for (double s : sum)
    estimate.mean += s / static_cast<double>(points_per_replicate * kReplicateCount);
  for (double s : sum) {
    const double off = s / static_cast<double>(points_per_replicate) - estimate.mean;
    estimate.standard_error += off * off;
  }
  estimate.standard_error =
      std::sqrt(estimate.standard_error / (kReplicateCount * (kReplicateCount - 1)));
  return estimate;
}

// Tolerance: six standard errors, plus a fraction of the expected value for rounding in float
// samples.
inline void ExpectNear(const Estimate& estimate, double expected, double tolerance = 1e-6) {
  EXPECT_NEAR(estimate.mean, expected,
              6 * estimate.standard_error + tolerance * std::fabs(expected));
}

// Mean of red radiance * max(cos, 0) / pdf at p with normal n: the irradiance.
inline Estimate EstimateIrradiance(const LightTable& table, Vec3f p, Vec3f n,
                                   uint64_t points_per_replicate = 1024) {
  return EstimateMean(points_per_replicate, [&](const std::array<float, 4>& u) {
    const auto sample = table.Sample<kAllTraits>(p, n, u[0], {u[1], u[2]});
    if (!sample) return 0.0;
    const double cosine = Dot(ToDouble(sample->wi), ToDouble(n));
    return cosine > 0
               ? static_cast<double>(sample->radiance.r) * cosine / static_cast<double>(sample->pdf)
               : 0.0;
  });
}

// Writes a square color map as PFM (bottom row first); row 0 of texels is the top.
inline void WritePfm(const std::string& path, int size, const std::vector<Rgb>& texels) {
  std::ofstream out(path, std::ios::binary);
  out << "PF\n" << size << ' ' << size << "\n-1\n";
  for (int y = size - 1; y >= 0; --y) {
    const Rgb* row = &texels[static_cast<size_t>(y) * static_cast<size_t>(size)];
    out.write(reinterpret_cast<const char*>(row),
              static_cast<std::streamsize>(static_cast<size_t>(size) * sizeof(Rgb)));
  }
  SHEAF_CHECK(out.good());
}

}  // namespace sheaf::render::testing
