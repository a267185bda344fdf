// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of light that is narrow, or of extreme radiance, as in docs/hard-cases.md: L41, L42.
#include <cmath>
#include <cstdio>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/support/hard_case.h"
#include "tests/support/scene_text.h"
#include "tests/support/test_scene.h"

namespace sheaf::render {
namespace {

std::string Digits(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", x);
  return text;
}
// A triangle of height 1.
std::string Line(double nm, double half_width) {
  return "[" + Digits(nm - half_width) + " 0 " + Digits(nm) + " 1 " + Digits(nm + half_width) +
         " 0]";
}
std::string Lit(const std::string& sky, const std::string& reflectance) {
  return R"(LookAt 0 0 -4  0 0 0  0 1 0
Camera "perspective" "float fov" 40
PixelFilter "box"
WorldBegin
LightSource "infinite" )" +
         sky + "\nMaterial \"diffuse\" " + reflectance + R"(
Shape "trianglemesh" "point3 P" [-9 -9 0  9 -9 0  9 9 0  -9 9 0] "integer indices" [0 1 2 0 2 3]
)";
}
TileMean RenderSpectral(const std::string& text, uint64_t samples) {
  FrameSettings settings = SquareSettings(16, samples, 1);
  settings.color = ColorTransport::kSpectral;
  return RenderMean(testing::ReadSceneText(text), settings);
}
// The luminance of linear sRGB, with its standard error, as if all channels were correlated.
struct LuminanceOf {
  explicit LuminanceOf(const TileMean& mean) {
    const double weights[3] = {0.2126, 0.7152, 0.0722};
    for (size_t c = 0; c < 3; ++c) {
      value += weights[c] * static_cast<double>(mean.mean[c]);
      error += weights[c] * static_cast<double>(mean.standard_error[c]);
    }
  }
  double value = 0, error = 0;
};
// The integral of a line in a table with steps of 1 nm, by linear interpolation.
double OfTable(double nm, double half_width) {
  double sum = 0;
  for (const double at : {std::floor(nm), std::floor(nm) + 1}) {
    sum += std::fmax(0, 1 - std::fabs(at - nm) / half_width);
  }
  return sum;
}

const char kWhite[] = "\"rgb reflectance\" [1 1 1]";

TEST(ExtremeLightStability, L41LampsOfOneLineHaveTheirLuminance) {
  for (const double half_width : {1.0, 0.5, 0.2, 0.05}) {
    for (const double nm : {532.5, 589.0, 589.3}) {
      const LuminanceOf y(
          RenderSpectral(Lit("\"spectrum L\" " + Line(nm, half_width), kWhite), 256));
      ExpectHardCase(
          {.row = "L41",
           .figure = "luminance of a lamp of " + InWords(nm) + " +- " + InWords(half_width) + " nm",
           .expected = 1,
           .measured = y.value,
           .standard_error = y.error,
           .tolerance = 2e-3,
           .naive = OfTable(nm, half_width) / half_width,
           .naive_by = "the line's values at whole nanometers"});
    }
  }
}

TEST(ExtremeLightStability, L41FiltersKeepTheirWidth) {
  const double white = 106.9;  // The integral of the luminous efficiency.
  for (const double half_width : {1.0, 0.2, 0.05}) {
    const LuminanceOf y(RenderSpectral(
        Lit("\"spectrum L\" [300 1 900 1]", "\"spectrum reflectance\" " + Line(532, half_width)),
        1024));
    // The efficiency at 532 nm is 0.8867.
    ExpectHardCase({.row = "L41",
                    .figure = "luminance behind a filter of 532 +- " + InWords(half_width) + " nm",
                    .expected = half_width * 0.8867 / white,
                    .measured = y.value,
                    .standard_error = y.error,
                    .tolerance = 5e-3 * half_width / white,
                    .naive = OfTable(532, half_width) * 0.8867 / white,
                    .naive_by = "the filter's values at whole nanometers"});
  }
  // A line through a filter that is three times as wide.
  const LuminanceOf y(RenderSpectral(
      Lit("\"spectrum L\" " + Line(589.3, 0.1), "\"spectrum reflectance\" " + Line(589.3, 0.3)),
      256));
  ExpectHardCase({.row = "L41",
                  .figure = "luminance of a line behind a filter of three times its width",
                  .expected = 1 - 0.1 / 3 / 0.3,
                  .measured = y.value,
                  .standard_error = y.error,
                  .tolerance = 2e-3,
                  .naive = 0,
                  .naive_by = "the values at whole nanometers"});
}

// The mean over a lit ball and its sky, relative to that of a sky of 1.
std::string Ball(double radiance) {
  const std::string l = Digits(radiance);
  return R"(LookAt 0 3 -4  0 0 0  0 1 0
Camera "perspective" "float fov" 40
PixelFilter "box"
WorldBegin
LightSource "infinite" "rgb L" [)" +
         l + " " + l + " " + l + R"(]
Material "diffuse" "rgb reflectance" [.5 .5 .5]
Shape "sphere"
)";
}

TEST(ExtremeLightStability, L42RadianceOfAnyMagnitudeIsRightOrRefused) {
  const FrameSettings settings = SquareSettings(16, 64, 3);
  const double of_one = RenderMean(testing::ReadSceneText(Ball(1)), settings).mean.g;
  for (const double radiance : {1e-25, 1e-20, 1e-10, 1e10, 1e20, 1e25}) {
    const TileMean mean = RenderMean(testing::ReadSceneText(Ball(radiance)), settings);
    EXPECT_EQ(mean.non_finite, 0u) << radiance;
    ExpectHardCase(
        {.row = "L42",
         .figure = "image under a sky of " + InWords(radiance) + ", over that of 1",
         .expected = 1,
         .measured = static_cast<double>(mean.mean.g) / radiance / of_one,
         .tolerance = 1e-4,
         .naive = static_cast<double>(static_cast<float>(radiance) * static_cast<float>(radiance)) /
                  radiance / radiance,
         .naive_by = "the square of the radiance"});
  }
  for (const double radiance : {1e26, 1e30, 3e38}) {
    TableFileSource files({});
    const auto compiled = CompileScene(testing::ReadSceneText(Ball(radiance)), settings, files, {});
    ASSERT_FALSE(compiled.ok()) << radiance;
    EXPECT_EQ(compiled.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(compiled.status().message(), ::testing::HasSubstr("main.pbrt:5:1: "));
  }
}

}  // namespace
}  // namespace sheaf::render
