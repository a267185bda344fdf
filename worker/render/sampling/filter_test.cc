// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/sampling/filter.h"

#include <cmath>
#include <functional>
#include <numbers>
#include <string>

#include "gtest/gtest.h"

namespace sheaf::render {
namespace {

using Kind = FilterDescription::Kind;

SceneDescription SceneWith(Kind kind, float radius_x_px, float radius_y_px) {
  SceneDescription scene;
  scene.files = {"room.pbrt"};
  scene.filter.kind = kind;
  scene.filter.radius_x_px = radius_x_px;
  scene.filter.radius_y_px = radius_y_px;
  scene.filter.location = {0, 4, 1};
  return scene;
}

// The published filters, as functions of a distance in pixels.
double FilterAt(Kind kind, double x_px, double radius_px) {
  const double x = std::fabs(x_px);
  switch (kind) {
    case Kind::kBox:
      return 1;
    case Kind::kTriangle:
      return radius_px - x;
    case Kind::kGaussian:
      return std::exp(-2 * x * x) - std::exp(-2 * radius_px * radius_px);  // Sigma 0.5.
    case Kind::kMitchell: {
      // B = C = 1/3, in units of half the radius.
      const double v = 2 * x / radius_px;
      return v < 1 ? (7 * v * v * v - 12 * v * v + 16.0 / 3) / 6
                   : (-7.0 / 3 * v * v * v + 12 * v * v - 20 * v + 32.0 / 3) / 6;
    }
    case Kind::kSinc: {
      const auto sinc = [](double t) {
        return t == 0 ? 1 : std::sin(std::numbers::pi * t) / (std::numbers::pi * t);
      };
      return sinc(x) * sinc(x / 3);  // Lanczos of three lobes.
    }
  }
  return 0;
}
double Integral(double from, double to, const std::function<double(double)>& f) {
  constexpr int kSteps = 4000;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) sum += f(from + (to - from) * (i + 0.5) / kSteps);
  return sum * (to - from) / kSteps;
}

class PixelFilterTest : public ::testing::TestWithParam<Kind> {};

// The fraction of |f| up to each sampled position is the number it was sampled from.
TEST_P(PixelFilterTest, PositionsInvertTheFilterMagnitude) {
  constexpr double kRadius = 1.75;
  const auto filter = PixelFilter::Make(SceneWith(GetParam(), 1.75f, 0.5f));
  ASSERT_TRUE(filter.ok()) << filter.status();
  const auto magnitude = [](double x) { return std::fabs(FilterAt(GetParam(), x, kRadius)); };
  const double whole = Integral(-kRadius, kRadius, magnitude);
  for (int i = 0; i < 128; ++i) {
    const auto u = static_cast<float>((i + 0.5) / 128);
    const FilterSample sample = filter->Sample({u, 0.25f});
    EXPECT_NEAR(Integral(-kRadius, sample.offset.x, magnitude) / whole, u, 2e-5) << i;
  }
}

// Weighted samples reproduce the filter's mean and moments, including negative lobes.
TEST_P(PixelFilterTest, WeightedSamplesHaveTheFilterMoments) {
  constexpr double kRadiusX = 2, kRadiusY = 1.5;
  const auto filter = PixelFilter::Make(SceneWith(GetParam(), 2, 1.5f));
  ASSERT_TRUE(filter.ok()) << filter.status();
  constexpr int kSide = 2048;
  double weights = 0, xx = 0, yy = 0, x_mean = 0;
  for (int i = 0; i < kSide * kSide; ++i) {
    const FilterSample s = filter->Sample({static_cast<float>((i % kSide + 0.5) / kSide),
                                           static_cast<float>((i / kSide + 0.5) / kSide)});
    ASSERT_LE(std::fabs(s.offset.x), 2);
    ASSERT_LE(std::fabs(s.offset.y), 1.5f);
    const double w = s.weight, x = s.offset.x, y = s.offset.y;
    weights += w;
    x_mean += w * x;
    xx += w * x * x;
    yy += w * y * y;
  }
  const auto second_moment = [](double radius) {
    return Integral(0, radius, [&](double x) { return x * x * FilterAt(GetParam(), x, radius); }) /
           Integral(0, radius, [&](double x) { return FilterAt(GetParam(), x, radius); });
  };
  constexpr double kCount = double{kSide} * kSide;
  EXPECT_NEAR(weights / kCount, 1, 3e-3);
  EXPECT_NEAR(x_mean / kCount, 0, 1e-5);
  EXPECT_NEAR(xx / kCount, second_moment(kRadiusX), 1e-2);
  EXPECT_NEAR(yy / kCount, second_moment(kRadiusY), 1e-2);
}

// Evaluate is the published filter over its integral, which Sample inverts.
TEST_P(PixelFilterTest, ValuesAreTheFilterOverItsIntegral) {
  constexpr double kRadiusX = 1.75, kRadiusY = 0.5;
  const auto filter = PixelFilter::Make(SceneWith(GetParam(), 1.75f, 0.5f));
  ASSERT_TRUE(filter.ok()) << filter.status();
  const auto normalized = [](double x, double radius) {
    const auto f = [radius](double v) { return FilterAt(GetParam(), v, radius); };
    return f(x) / Integral(-radius, radius, f);
  };
  for (const double x : {-1.7, -1.2, -0.3, 0.0, 0.9, 1.6}) {
    for (const double y : {-0.45, 0.0, 0.2}) {
      EXPECT_NEAR(filter->Evaluate({x, y}), normalized(x, kRadiusX) * normalized(y, kRadiusY), 2e-4)
          << x << ", " << y;
    }
  }
  for (const Vec2d beyond : {Vec2d{1.76, 0}, Vec2d{-1.76, 0}, Vec2d{0, 0.51}, Vec2d{0, -0.51}}) {
    EXPECT_EQ(filter->Evaluate(beyond), 0);
  }
}

// A weight has the sign of the filter, and the same magnitude everywhere.
TEST_P(PixelFilterTest, WeightsCarryTheSign) {
  const auto filter = PixelFilter::Make(SceneWith(GetParam(), 2, 2));
  ASSERT_TRUE(filter.ok()) << filter.status();
  const float size = std::fabs(filter->Sample({0.5f, 0.5f}).weight);
  EXPECT_GE(size, 1);
  EXPECT_EQ(size > 1, GetParam() == Kind::kMitchell || GetParam() == Kind::kSinc);
  for (int i = 0; i < 1000; ++i) {
    const FilterSample s = filter->Sample({static_cast<float>((i + 0.5) / 1000), 0.5f});
    EXPECT_FLOAT_EQ(std::fabs(s.weight), size);
    const double value = FilterAt(GetParam(), static_cast<double>(s.offset.x), 2);
    if (std::fabs(value) > 1e-5) {
      EXPECT_EQ(s.weight < 0, value < 0) << s.offset.x;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(AllKinds, PixelFilterTest,
                         ::testing::Values(Kind::kBox, Kind::kTriangle, Kind::kGaussian,
                                           Kind::kMitchell, Kind::kSinc));

// Each point of the film, also of a pixel's edge, lies in one pixel.
TEST(PixelFilter, BoxesOfOnePixelDivideTheFilm) {
  const auto filter = PixelFilter::Make(SceneWith(Kind::kBox, 0.5f, 0.5f));
  ASSERT_TRUE(filter.ok()) << filter.status();
  for (const double x : {3.0, 3.25, 3.5, 3.999, 4.0}) {
    double sum = 0;
    for (int pixel = 0; pixel < 8; ++pixel) sum += filter->Evaluate({x - (pixel + 0.5), 0.0});
    EXPECT_EQ(sum, 1) << x;
  }
}

// Each pixel samples one point of the film; in the middle their densities add up to about 1.
TEST_P(PixelFilterTest, AFrameSamplesOnePointAPixel) {
  const auto filter = PixelFilter::Make(SceneWith(GetParam(), 1.5f, 2));
  ASSERT_TRUE(filter.ok()) << filter.status();
  constexpr int kWidth = 5, kHeight = 3;
  constexpr double kStep = 1.0 / 64;
  double sum = 0;
  for (double y = -2 + kStep / 2; y < kHeight + 2; y += kStep) {
    for (double x = -2 + kStep / 2; x < kWidth + 2; x += kStep) {
      sum += filter->SamplesAt({x, y}, kWidth, kHeight) * kStep * kStep;
    }
  }
  EXPECT_NEAR(sum, kWidth * kHeight, 0.01 * kWidth * kHeight);
  EXPECT_NEAR(filter->SamplesAt({20.25, 20.75}, 40, 40), 1, 0.25);
  EXPECT_EQ(filter->SamplesAt({-1.6, 1}, kWidth, kHeight), 0);
  EXPECT_EQ(filter->SamplesAt({1, kHeight + 2.1}, kWidth, kHeight), 0);
}

TEST(PixelFilterErrors, NameFilterAndReason) {
  SceneDescription no_sigma = SceneWith(Kind::kGaussian, 2, 2);
  no_sigma.filter.sigma = 0;
  SceneDescription no_tau = SceneWith(Kind::kSinc, 4, 4);
  no_tau.filter.tau = 0;
  for (const SceneDescription& scene :
       {SceneWith(Kind::kBox, 0, 1), SceneWith(Kind::kBox, 1, std::nanf("")),
        SceneWith(Kind::kTriangle, 1, HUGE_VALF), no_sigma, no_tau}) {
    const auto filter = PixelFilter::Make(scene);
    ASSERT_FALSE(filter.ok());
    EXPECT_EQ(filter.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_NE(std::string(filter.status().message()).find("room.pbrt:4:1"), std::string::npos);
  }
}

}  // namespace
}  // namespace sheaf::render
