// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/surrounding/surrounding.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

namespace sheaf::gltf {
namespace {

constexpr char kHead[] = "PF\n64 64\n-1.0\n";
constexpr size_t kTexels = 64 * 64;
constexpr double kPi = 3.141592653589793;

std::vector<float> Texels() {
  const std::string bytes = SurroundingMap();
  std::vector<float> texels(3 * kTexels);
  EXPECT_EQ(bytes.size(), std::strlen(kHead) + texels.size() * sizeof(float));
  EXPECT_EQ(bytes.substr(0, std::strlen(kHead)), kHead);
  std::memcpy(texels.data(), bytes.data() + std::strlen(kHead), texels.size() * sizeof(float));
  return texels;
}

// Radiance is a + b max(z, 0)^2. Its mean over the sphere is a + b/6; the radiance of a white
// diffuse surface that faces up is the mean over the hemisphere by the cosine: a + b/2.
TEST(SurroundingTest, LightsAsItsClosedFormsSay) {
  const double a = kHorizonRadiance, b = kZenithRadiance - kHorizonRadiance;
  const std::vector<float> texels = Texels();
  double sum = 0, facing_up = 0;
  for (size_t i = 0; i < kTexels; ++i) {
    const double radiance = texels[3 * i];
    EXPECT_EQ(texels[3 * i + 1], texels[3 * i]);
    EXPECT_EQ(texels[3 * i + 2], texels[3 * i]);
    sum += radiance;
    facing_up += radiance * std::sqrt(std::max(0.0, (radiance - a) / b)) * 4 * kPi / kTexels / kPi;
  }
  EXPECT_NEAR(sum / kTexels, a + b / 6, 1e-3);
  EXPECT_NEAR(facing_up, a + b / 2, 1e-3);
  EXPECT_NEAR(texels[3 * (32 * 64 + 32)], kZenithRadiance, 5e-3);
  EXPECT_EQ(texels[0], kHorizonRadiance);
}

TEST(SurroundingTest, IsBrightAbove) {
  const Vec3d up = TransformVector(WorldFromSurrounding(), {0, 0, 1});
  EXPECT_EQ(up, (Vec3d{0, 1, 0}));
  EXPECT_EQ(Determinant3(WorldFromSurrounding()), 1);
}

}  // namespace
}  // namespace sheaf::gltf
