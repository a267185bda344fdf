// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "worker/render/densities/running_density.h"
#include "worker/render/densities/weights.h"

namespace sheaf::render {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(WeightOfTest, IsThePowerHeuristic) {
  EXPECT_DOUBLE_EQ(WeightOf(1.0, 2.0), 0.2);
  EXPECT_DOUBLE_EQ(WeightOf(2.0, 1.0, 3.0), 4.0 / 14);
  EXPECT_DOUBLE_EQ(WeightOf(1.0, 2.0, 3.0, 4.0), 1.0 / 30);
  EXPECT_FLOAT_EQ(WeightOf(3.0f, 1.0f), 0.9f);
}

// Two densities have a form of their own.
TEST(WeightOfTest, TwoDensitiesWeighAsThreeOfWhichOneIsZero) {
  const std::vector<float> values{
      0, 1e-38f, 3e-20f, 0.25f, 1, 7.5f, 1e19f, 3e38f, std::numeric_limits<float>::infinity()};
  for (const float f : values) {
    for (const float g : values) {
      if (f == 0 && g == 0) continue;
      EXPECT_EQ(WeightOf(f, g), WeightOf(f, g, 0.0f)) << f << " " << g;
    }
  }
}

TEST(WeightOfTest, SumsToOneAtAllMagnitudes) {
  const std::vector<double> values{0, 5e-324, 1e-200, 1e-3, 1, 40, 1e160, 1e308, kInfinity};
  for (const double a : values) {
    for (const double b : values) {
      for (const double c : values) {
        const double sum = WeightOf(a, b, c) + WeightOf(b, a, c) + WeightOf(c, a, b);
        EXPECT_NEAR(sum, 1, 1e-15) << a << " " << b << " " << c;
      }
    }
  }
}

TEST(RunningDensityTest, EndsAreReciprocal) {
  RunningDensity<PathEnd::kCamera> light_paths;
  RunningDensity<PathEnd::kLight> camera_paths;
  light_paths.Start(3);
  camera_paths.Start(1.0 / 3);
  for (const StepDensities& step :
       {StepDensities{0.5, 0.25, 2}, SpecularStep(0.5, 2.25, 0.8, 1.25), StepDensities{4, 1, 1}}) {
    light_paths.Add(step);
    camera_paths.Add(step);
  }
  EXPECT_DOUBLE_EQ(light_paths.ratio(), 3 * (0.25 * 2 / 0.5) * (1.25 / (0.5 * 2.25 * 0.8)) / 4);
  EXPECT_DOUBLE_EQ(light_paths.ratio() * camera_paths.ratio(), 1);
}

TEST(RunningDensityTest, ALossOfRangeLeavesTheOtherTechniqueAlone) {
  RunningDensity<PathEnd::kCamera> light_paths;
  light_paths.Start(1);
  light_paths.Add({.cosines = kInfinity});
  EXPECT_FALSE(light_paths.IsFound());
  RunningDensity<PathEnd::kLight> camera_paths;
  camera_paths.Start(1);
  camera_paths.Add({.cosines = 0});
  EXPECT_EQ(WeightOf(1.0, camera_paths.ratio()), 0);
}

TEST(RunningDensityTest, StoppedPathsStayUnfound) {
  RunningDensity<PathEnd::kCamera> light_paths;
  light_paths.Start(2);
  light_paths.Stop();
  light_paths.Add({});
  EXPECT_FALSE(light_paths.IsFound());
}

}  // namespace
}  // namespace sheaf::render
