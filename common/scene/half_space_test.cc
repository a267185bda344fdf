// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/half_space.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace sheaf {
namespace {

// Values of Chandrasekhar's H functions: 1 - 2 sqrt(1 - albedo) times the first moment of H.
TEST(HalfSpaceTest, DiffuseAlbedoAtMatchedIndex) {
  const double expected[][2] = {
      {0.5, .146544}, {0.8, .341867}, {0.9, .478024}, {0.99, .794564}, {0.999, .929713}};
  for (const auto& [albedo, reflectance] : expected) {
    EXPECT_NEAR(HalfSpaceReflectance(albedo, 1), reflectance, 1e-3) << albedo;
  }
}

// Light reflected back by the boundary is partly absorbed before it can leave.
TEST(HalfSpaceTest, BoundariesReduceTheAlbedo) {
  for (const double albedo : {0.1, 0.5, 0.9, 0.99}) {
    double before = HalfSpaceReflectance(albedo, 1);
    for (const double eta : {1.1, 1.33, 1.5, 2.0}) {
      const double now = HalfSpaceReflectance(albedo, eta);
      EXPECT_LT(now, before) << albedo << " " << eta;
      before = now;
    }
  }
}

TEST(HalfSpaceTest, AlbedoIsOneWithoutAbsorption) {
  for (const double eta : {0.8, 1.0, 1.5}) {
    EXPECT_EQ(HalfSpaceReflectance(1, eta), 1);
    EXPECT_EQ(HalfSpaceReflectance(0, eta), 0);
    EXPECT_NEAR(HalfSpaceReflectance(1 - 1e-10, eta), 1, 2e-3);
  }
}

TEST(HalfSpaceTest, InverseRoundTrips) {
  for (const double eta : {1.0, 1.33, 1.5}) {
    for (const double reflectance : {0.01, 0.2, 0.5, 0.8, 0.97}) {
      const double albedo = AlbedoForReflectance(reflectance, eta, 0);
      EXPECT_NEAR(HalfSpaceReflectance(albedo, eta), reflectance, 1e-4);
      const double forward = AlbedoForReflectance(reflectance, eta, 0.5);
      EXPECT_NEAR(forward * 0.5 / (1 - forward * 0.5), albedo, 1e-12);
    }
  }
  EXPECT_EQ(AlbedoForReflectance(-1, 1.3, 0), 0);
  EXPECT_EQ(AlbedoForReflectance(2, 1.3, 0), 1);
}

TEST(AlbedoCurveTest, AgreesWithTheInverse) {
  for (const double eta : {1.0, 1.33, 1.8, 0.7}) {
    for (const double g : {0.0, 0.6, -0.4}) {
      const AlbedoCurve curve(eta, g);
      EXPECT_EQ(curve.At(-1), 0);
      EXPECT_EQ(curve.At(0), 0);
      EXPECT_EQ(curve.At(1), 1);
      EXPECT_EQ(curve.At(2), 1);
      EXPECT_TRUE(std::isnan(curve.At(std::numeric_limits<float>::quiet_NaN())));
      for (const double reflectance : {0.001, 0.02, 0.1, 0.37, 0.5, 0.83, 0.97, 0.999}) {
        const auto albedo = static_cast<double>(curve.At(static_cast<float>(reflectance)));
        const double isotropic = albedo * (1 - g) / (1 - albedo * g);
        // Beyond .99 the quadrature itself is not more accurate.
        EXPECT_NEAR(HalfSpaceReflectance(isotropic, eta), reflectance,
                    reflectance > 0.99 ? 2e-3 : 1e-4)
            << eta << " " << g;
      }
    }
  }
}

}  // namespace
}  // namespace sheaf
