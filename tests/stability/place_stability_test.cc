// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of places that float has no digits for, as in docs/hard-cases.md: G21, G23
// to G25, V16.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/support/hard_case.h"
#include "tests/support/scene_text.h"
#include "tests/support/test_scene.h"
#include "worker/render/plan/path_limits.h"

namespace sheaf::render {
namespace {

std::string Number(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", x);
  return text;
}
std::string Shift(Vec3d by) {
  return "Translate " + Number(by.x) + " " + Number(by.y) + " " + Number(by.z) + "\n";
}

// Means of blocks of 8 x 8 pixels, of all three colors.
std::vector<double> BlocksOf(const FilmTile& tile) {
  constexpr int32_t kSide = 8;
  const int32_t width = tile.rect().Width(), height = tile.rect().Height();
  const FilmChannel high[3] = {FilmChannel::kRedHi, FilmChannel::kGreenHi, FilmChannel::kBlueHi};
  std::vector<double> blocks;
  for (int32_t y = 0; y < height; y += kSide) {
    for (int32_t x = 0; x < width; x += kSide) {
      for (const FilmChannel channel : high) {
        double sum = 0, weight = 0;
        for (int32_t dy = 0; dy < kSide; ++dy) {
          for (int32_t dx = 0; dx < kSide; ++dx) {
            const auto at = static_cast<size_t>((y + dy) * width + x + dx);
            sum += static_cast<double>(tile.channel(channel)[at]);
            weight += static_cast<double>(tile.channel(FilmChannel::kWeight)[at]);
          }
        }
        blocks.push_back(sum / weight);
      }
    }
  }
  return blocks;
}
std::vector<double> BlocksOf(const std::string& text, uint64_t samples) {
  return BlocksOf(
      RenderAll(*Compile(testing::ReadSceneText(text), SquareSettings(32, samples, 2))));
}
double LargestDifference(const std::vector<double>& a, const std::vector<double>& b) {
  double largest = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    largest = std::fmax(largest, std::fabs(a[i] - b[i]) / std::fmax(std::fabs(b[i]), 0.01));
  }
  return largest;
}

// A floor and a ball with a texture by position, all of it with its camera moved.
std::string MovedScene(const std::string& texture, const std::string& material, Vec3d by) {
  return "LookAt 0 3 -4  0 0 0  0 1 0\n" + Shift(-by) +
         R"(Camera "perspective" "float fov" 40
Film "rgb" "integer xresolution" 32 "integer yresolution" 32
PixelFilter "box"
WorldBegin
)" + Shift(by) +
         R"(LightSource "infinite" "rgb L" [1 1 1]
LightSource "distant" "point3 from" [2 1 0] "point3 to" [0 0 0]
Translate 0.01 0.013 .017
)" + texture +
         material + R"(
Shape "trianglemesh" "point3 P" [-3 -0.4 -3  -3 -0.4 3  3 -0.4 3  3 -0.4 -3]
  "integer indices" [0 1 2 0 2 3]
Shape "sphere" "float radius" 1
)";
}

// The naive difference: the part of a unit by which a float at this distance is off.
double RoundingAt(double distance) {
  const double place = distance + 0.3;
  return std::fabs(static_cast<double>(static_cast<float>(place)) - place);
}

TEST(PlaceStability, G21TexturesByPositionDoNotDependOnTheDistanceFromTheOrigin) {
  const std::string colors = R"( "rgb tex1" [.9 .9 .9] "rgb tex2" [.1 .1 .1])"
                             "\n";
  const std::string checkers = R"(Texture "t" "spectrum" "checkerboard" )";
  const std::string surface = R"(Material "diffuse" "texture reflectance" "t")";
  const std::string planar =
      R"("string mapping" "planar" "vector3 v1" [1 0 0] "vector3 v2" [0 0 1] "float udelta" .3)";
  const struct {
    const char* name;
    std::string texture, material;
  } kCases[] = {{"solid", checkers + R"("integer dimension" 3)" + colors, surface},
                {"planar", checkers + planar + colors, surface},
                {"spherical", checkers + R"("string mapping" "spherical")" + colors, surface},
                {"cylindrical", checkers + R"("string mapping" "cylindrical")" + colors, surface},
                {"bump",
                 R"(Texture "t" "float" "checkerboard" "integer dimension" 3
"float tex1" 0 "float tex2" .002
)",
                 R"(Material "diffuse" "rgb reflectance" [1 1 1] "texture displacement" "t")"}};
  for (const auto& c : kCases) {
    SCOPED_TRACE(c.name);
    const std::vector<double> still = BlocksOf(MovedScene(c.texture, c.material, {}), 16);
    for (const double distance : {1e5, 1e6, 1e7}) {
      const Vec3d by = Vec3d{1.1, 0.7, -1.3} * distance;
      const std::vector<double> moved = BlocksOf(MovedScene(c.texture, c.material, by), 16);
      ExpectHardCase(
          {.row = "G21",
           .figure = "largest difference of a part of the image, moved by " + InWords(distance),
           .expected = 0,
           .measured = LargestDifference(moved, still),
           .tolerance = 1e-3,
           .naive = RoundingAt(1.1 * distance),
           .naive_by = "the place's rounding to float, of a cell of 1"});
    }
  }
}

// A scene of `world` before a sky of 1, seen from 4 units.
std::string UnderSky(const std::string& world, const std::string& before = "") {
  return "LookAt 0 0 -4  0 0 0  0 1 0\n" + before +
         R"(Camera "perspective" "float fov" 40
PixelFilter "box"
WorldBegin
LightSource "infinite" "rgb L" [1 1 1]
Material "diffuse" "rgb reflectance" [1 1 1]
)" + world;
}

// The ray tracer ends the process if a ray leaves its range.
TEST(PlaceStability, G23RaysOutOfRangeMeetNothing) {
  const std::string box = R"(ObjectBegin "o"
Shape "trianglemesh" "point3 P" [-.5 -.5 -.5  .5 -.5 -.5  .5 .5 -.5  -.5 .5 -.5
    -.5 -.5 .5  .5 -.5 .5  .5 .5 .5  -.5 .5 .5]
  "integer indices" [0 2 1 0 3 2 4 5 6 4 6 7 0 1 5 0 5 4 2 3 7 2 7 6 1 2 6 1 6 5 0 4 7 0 7 3]
ObjectEnd
)";
  const auto record = [](const std::string& what, double expected, const std::string& text) {
    SCOPED_TRACE(text);
    const TileMean mean = RenderMean(testing::ReadSceneText(text), SquareSettings(8, 16, 50));
    EXPECT_EQ(mean.non_finite, 0u);
    ExpectHardCase({.row = "G23",
                    .figure = "radiance under a sky of 1 of " + what,
                    .expected = expected,
                    .measured = mean.mean.g,
                    .tolerance = 1e-6});
  };
  for (const double scale : {1e-12, 1e-16, 1e-17, 1e-18, 1e-25, 1e-40}) {
    const std::string scaled =
        "Scale " + Number(scale) + " " + Number(scale) + " " + Number(scale) + "\n";
    record("an object scaled by " + InWords(scale), 1,
           UnderSky(box + scaled + "ObjectInstance \"o\"\n"));
  }
  for (const double sigma : {1e-6, 1e-17, 1e-22, 1e-37}) {
    const std::string three = Number(sigma) + " " + Number(sigma) + " " + Number(sigma);
    record(
        "a white ball in fog of " + InWords(sigma), 0,  // No light comes through fog without end.
        UnderSky("Shape \"sphere\"\n",
                 "MakeNamedMedium \"fog\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [0 0 0] "
                 "\"rgb sigma_s\" [" +
                     three + "]\nMediumInterface \"\" \"fog\"\n"));
  }
}

// Shapes beyond the reach of rays are refused, with their place in the file.
TEST(PlaceStability, G23ShapesOutOfRangeAreRefused) {
  const std::string big = "Scale 1e20 1e20 1e20\n";
  const std::string moves = "ActiveTransform EndTime Translate 0 0 1e19 ActiveTransform All\n";
  const struct {
    std::string text;
    int line;
  } kCases[] = {{UnderSky(big + "Shape \"sphere\"\n"), 8},
                {UnderSky(big + "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]\n"), 8},
                {UnderSky("ObjectBegin \"o\"\nShape \"sphere\"\nObjectEnd\n" + big +
                          "ObjectInstance \"o\"\n"),
                 11},
                {UnderSky(moves + "Shape \"sphere\"\n"), 8}};
  for (const auto& c : kCases) {
    SCOPED_TRACE(c.text);
    TableFileSource files({});
    const auto compiled =
        CompileScene(testing::ReadSceneText(c.text), SquareSettings(8, 16, 50), files, {});
    ASSERT_FALSE(compiled.ok());
    EXPECT_EQ(compiled.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(compiled.status().message(),
                ::testing::HasSubstr("main.pbrt:" + std::to_string(c.line) + ":"));
    EXPECT_THAT(compiled.status().message(), ::testing::HasSubstr("1e18"));
  }
}

// `count` sheets of opacity `alpha` (0: interfaces) between the camera and a sky of 1, or between a
// floor and it.
std::string Sheets(int count, double alpha) {
  std::string points, indices;
  for (int i = 0; i < count; ++i) {
    const std::string z = " " + Number(1 + i * 1e-3);
    for (const char* xy : {"-9 -9", " 9 -9", " 9 9", " -9 9"}) points += xy + z;
    for (const int k : {0, 1, 2, 0, 2, 3}) indices += " " + std::to_string(4 * i + k);
    points += "\n";
    indices += "\n";
  }
  return std::string(alpha > 0 ? "" : "Material \"interface\"\n") +
         "Shape \"trianglemesh\" \"point3 P\" [" + points + "] \"integer indices\" [" + indices +
         "]" + (alpha > 0 ? "\"float alpha\" " + Number(alpha) : "") + "\n";
}

TEST(PlaceStability, G25SheetsThatLetLightThroughHaveNoSmallLimit) {
  for (const int count : {1024, 1025, 3000}) {
    for (const double alpha : {0.0, 0.0002}) {
      for (const bool is_shadow : {false, true}) {
        const std::string text =
            is_shadow
                ? "LookAt 0 0 0.5  0 0 0  0 1 0\nCamera \"perspective\" \"float fov\" 20\n"
                  "PixelFilter \"box\"\nWorldBegin\n"
                  "LightSource \"distant\" \"point3 from\" [0 0 1] \"point3 to\" [0 0 0] \"rgb L\" "
                  "[1 1 1]\n"
                  "Material \"diffuse\" \"rgb reflectance\" [1 1 1]\nShape \"disk\"\n" +
                      Sheets(count, alpha)
                : "LookAt 0 0 0  0 0 1  0 1 0\nCamera \"perspective\" \"float fov\" 20\n"
                  "PixelFilter \"box\"\nWorldBegin\nLightSource \"infinite\" \"rgb L\" [1 1 1]\n"
                  "Material \"diffuse\" \"rgb reflectance\" [0 0 0]\n" +
                      Sheets(count, alpha);
        const TileMean mean =
            RenderMean(testing::ReadSceneText(text), SquareSettings(2, 64, is_shadow ? 1 : 50));
        const double expected = std::pow(1 - alpha, count) / (is_shadow ? std::numbers::pi : 1);
        ExpectHardCase({.row = "G25",
                        .figure = std::string(is_shadow ? "shadow" : "radiance") + " behind " +
                                  std::to_string(count) +
                                  (alpha > 0 ? " cut-outs of .0002" : " interfaces"),
                        .expected = expected,
                        .measured = mean.mean.g,
                        .standard_error = mean.standard_error.g,
                        .tolerance = 1e-6,
                        .naive = count >= 1024 ? 0 : expected,
                        .naive_by = "1024 surfaces at most"});
      }
    }
  }
}

// Beyond the limit that keeps paths finite the light is lost, and counted.
TEST(PlaceStability, G25LightBeyondTheLimitIsCounted) {
  const std::string text =
      "LookAt 0 0 0  0 0 1  0 1 0\nCamera \"perspective\" \"float fov\" 5\n"
      "PixelFilter \"box\"\nWorldBegin\n"
      "LightSource \"infinite\" \"rgb L\" [1 1 1]\n" +
      Sheets(static_cast<int>(kNullCrossingsMax) + 1, 0);
  const CompiledScenePtr scene = Compile(testing::ReadSceneText(text), SquareSettings(1, 16, 50));
  RenderStats stats;
  const TileMean mean = MeanOf(RenderAll(*scene, &stats));
  EXPECT_EQ(mean.mean.g, 0);
  EXPECT_EQ(stats.long_segments, 16u);
}

// A lamp over a floor, seen from `distance` by a camera that shows the same of it everywhere.
std::string SeenFrom(double distance, bool is_orthographic) {
  const Vec3d from = Normalize(Vec3d{0.4, 0.5, -0.77}) * distance;
  const std::string camera =
      is_orthographic ? "Camera \"orthographic\" \"float screenwindow\" [-1 1 -1 1]\n"
                      : "Camera \"perspective\" \"float fov\" " +
                            Number(2 * std::atan(1 / distance) * 180 / std::numbers::pi) + "\n";
  return "LookAt " + Number(from.x) + " " + Number(from.y) + " " + Number(from.z) +
         "  0 0 0  0 1 0\n" + camera + R"(PixelFilter "box"
WorldBegin
AttributeBegin
Material "diffuse" "rgb reflectance" [0 0 0]
AreaLightSource "diffuse" "rgb L" [30 30 30]
Shape "trianglemesh" "point3 P" [0 0.7 0.1  0.2 0.7 0.1  0.2 0.7 0.3  0 0.7 0.3]
  "integer indices" [0 1 2 0 2 3]
AttributeEnd
AttributeBegin
Material "diffuse" "rgb reflectance" [1 1 1]
Translate 0 -.5 0
Rotate -90 1 0 0
Shape "disk" "float radius" 2
AttributeEnd
)";
}

TEST(PlaceStability, G24TheDistanceOfTheCameraDoesNotMatter) {
  for (const bool is_orthographic : {true, false}) {
    // From 100 on, both cameras show the same to 1 %.
    const std::vector<double> near = BlocksOf(SeenFrom(1e3, is_orthographic), 64);
    for (const double distance : {1e5, 1e6, 1e7, 1e9}) {
      ExpectHardCase(
          {.row = "G24",
           .figure = std::string("difference of the image of ") +
                     (is_orthographic ? "an orthographic" : "a perspective") + " camera at " +
                     InWords(distance),
           .expected = 0,
           .measured = LargestDifference(BlocksOf(SeenFrom(distance, is_orthographic), 64), near),
           .tolerance = 0.02,
           .naive = RoundingAt(distance) / 0.2,
           .naive_by = "the rounding of a corner, of the lamp's side"});
    }
  }
}

// Depth is that from the camera.
TEST(PlaceStability, G24DepthIsThatFromTheCamera) {
  for (const double distance : {1e3, 1e6}) {
    for (const bool is_orthographic : {true, false}) {
      const FilmTile tile = RenderAll(*Compile(
          testing::ReadSceneText(SeenFrom(distance, is_orthographic)), SquareSettings(8, 16, 1)));
      const auto middle = static_cast<size_t>(4 * 8 + 4);
      const double depth =
          tile.channel(FilmChannel::kDepth)[middle] / tile.channel(FilmChannel::kWeight)[middle];
      EXPECT_NEAR(depth / distance, 1, 0.005) << distance;
    }
  }
}

// The face of a box of isotropic medium, albedo .8, seen along its normal. turn: of all of it, the
// arguments of Rotate; or empty.
std::string DenseBox(double density, double distance, const std::string& light,
                     const std::string& turn) {
  const auto three = [&](double part) {
    const std::string x = Number(density * part);
    return "[" + x + " " + x + " " + x + "]";
  };
  return "LookAt 0 0 " + Number(-distance) + "  0 0 0  0 1 0\n" +
         (turn.empty() ? "" : "Rotate -" + turn) +
         "Camera \"orthographic\" \"float screenwindow\" [-.3 .3 -.3 .3]\n"
         "PixelFilter \"box\"\nWorldBegin\n" +
         (turn.empty() ? "" : "Rotate " + turn) + light +
         "MakeNamedMedium \"m\" \"string type\" \"homogeneous\" \"rgb sigma_a\" " + three(0.2) +
         " \"rgb sigma_s\" " + three(0.8) + R"(
Material "interface"
MediumInterface "m" ""
Shape "trianglemesh" "point3 P" [-1 -1 -1  1 -1 -1  1 1 -1  -1 1 -1  -1 -1 1  1 -1 1  1 1 1  -1 1 1]
  "integer indices" [0 2 1 0 3 2 4 5 6 4 6 7 0 1 5 0 5 4 2 3 7 2 7 6 1 2 6 1 6 5 0 4 7 0 7 3]
)";
}

TEST(PlaceStability, V16DenseMediaAreTheSameFromAnyDistance) {
  // H(1) of albedo .8; the reflectance along the normal under an even sky, and the radiance where
  // the light comes from the camera (Chandrasekhar 1960, sec. 13).
  const double h = (1 - 0.285255) / std::sqrt(0.2);
  const struct {
    const char* name;
    std::string text;
    double expected;
  } kLights[] = {{"sky", "LightSource \"infinite\" \"rgb L\" [1 1 1]\n", 1 - std::sqrt(0.2) * h},
                 {"lamp",
                  "LightSource \"distant\" \"point3 from\" [0 0 -1] \"point3 to\" [0 0 0] "
                  "\"rgb L\" [3.14159265 3.14159265 3.14159265]\n",
                  0.8 / 4 * h * h / 2}};
  for (const auto& light : kLights) {
    for (const auto& [density, distance] :
         {std::pair{1e2, 3.0}, {1e3, 3.0}, {1e5, 3.0}, {1e6, 3.0}, {1e4, 30.0}, {1e6, 30.0}}) {
      for (const char* turn : {"", "37 .3 1 .2\n"}) {
        SCOPED_TRACE(::testing::Message()
                     << light.name << " " << density << " " << distance << turn);
        const TileMean mean =
            RenderMean(testing::ReadSceneText(DenseBox(density, distance, light.text, turn)),
                       SquareSettings(8, 256, 400));
        EXPECT_EQ(mean.non_finite, 0u);
        ExpectHardCase({.row = "V16",
                        .figure = std::string("radiance under a ") + light.name + " of density " +
                                  InWords(density) + " from " + InWords(distance),
                        .expected = light.expected,
                        .measured = mean.mean.g,
                        .standard_error = mean.standard_error.g});
      }
    }
  }
}

}  // namespace
}  // namespace sheaf::render
