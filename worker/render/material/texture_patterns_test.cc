// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Textures that are computed from the place.
#include <cmath>
#include <memory>
#include <utility>

#include "common/math/perlin_noise.h"
#include "gtest/gtest.h"
#include "worker/render/color/wavelength_sampler.h"
#include "worker/render/material/material.h"
#include "worker/render/material/texture_program.h"

namespace sheaf::render {
namespace {

class TexturePatternsTest : public ::testing::Test {
 protected:
  template <typename Texture>
  void Add(bool is_color, Texture texture) {
    TextureDescription description;
    description.is_color = is_color;
    description.texture = std::move(texture);
    scene_.textures.push_back(std::move(description));
  }
  void Build() {
    TableFileSource files({});
    auto program = TextureProgram::Build(scene_, files, cache_, true);
    ASSERT_TRUE(program.ok()) << program.status();
    program_ = std::make_unique<TextureProgram>(*std::move(program));
  }
  float FloatAt(const TexturePoint& point) const { return program_->Float({.texture = 0}, point); }
  Rgb ColorAt(const TexturePoint& point) const {
    return program_->Value<Rgb>({.texture = 0, .value = {}, .spectrum = {}}, point, {});
  }

  SceneDescription scene_;
  TextureCache cache_{uint64_t{1} << 20};
  std::unique_ptr<TextureProgram> program_;
};

constexpr Vec3d kPlaces[] = {{0.3, 0.7, -0.2}, {-5.1, 2.2, 8.9}, {100.25, -3.5, 0.125}};

TEST_F(TexturePatternsTest, NoiseLiesInTheTexturesOwnSpace) {
  Matrix4 texture_from_world = TranslateMatrix({1, 2, 3});
  texture_from_world.m[0][1] = -0.5;
  Add(false,
      NoiseTexture{.octaves = 4, .roughness = 0.7f, .texture_from_world = texture_from_world});
  Build();
  for (const Vec3d p : kPlaces) {
    const double expected =
        FractalNoise(TransformPoint(texture_from_world, p), 4, static_cast<double>(0.7f));
    EXPECT_EQ(FloatAt({.uv = {}, .p_world = p}), static_cast<float>(expected));
  }
}

TEST_F(TexturePatternsTest, WrinklesAreAbsoluteValuesAndWindScalesWaves) {
  NoiseTexture noise;
  noise.kind = NoiseTexture::Kind::kWrinkled;
  noise.octaves = 3;
  Add(false, noise);
  Build();
  for (const Vec3d p : kPlaces) {
    EXPECT_EQ(FloatAt({.uv = {}, .p_world = p}), static_cast<float>(TurbulentNoise(p, 3, 0.5)));
  }
  std::get<NoiseTexture>(scene_.textures[0].texture).kind = NoiseTexture::Kind::kWindy;
  Build();
  for (const Vec3d p : kPlaces) {
    const double wind = std::fabs(FractalNoise(0.1 * p, 3, 0.5));
    EXPECT_FLOAT_EQ(FloatAt({.uv = {}, .p_world = p}),
                    static_cast<float>(wind * FractalNoise(p, 6, 0.5)));
  }
}

// A cell has its disc where the noise at its center is positive; one in five is exactly 0 there.
TEST_F(TexturePatternsTest, DotsAreDiscsInSomeOfTheCells) {
  DotsTexture dots;
  dots.value[0] = {.value = 1};
  Add(false, dots);
  Build();
  int inside = 0, count = 0, dotted = 0, cells = 0;
  for (int cell = 0; cell < 1024; ++cell) {
    const float s = static_cast<float>(cell % 32) - 0.5f, t = static_cast<float>(cell / 32) - 0.5f;
    int here = 0;
    for (int i = 0; i < 256; ++i) {
      const Vec2f uv{s + (static_cast<float>(i % 16) + 0.5f) / 16,
                     t + (static_cast<float>(i / 16) + 0.5f) / 16};
      here += FloatAt({.uv = uv, .p_world = {}}) > 0 ? 1 : 0;
    }
    inside += here;
    count += 256;
    dotted += here > 0 ? 1 : 0;
    ++cells;
    if (here > 0) {
      EXPECT_NEAR(here / 256.0, 3.14159265 * 0.35 * 0.35, 0.025) << cell;
    }
  }
  EXPECT_NEAR(dotted / static_cast<double>(cells), 0.4, 0.05);
  EXPECT_NEAR(inside / static_cast<double>(count),
              3.14159265 * 0.35 * 0.35 * dotted / static_cast<double>(cells), 0.01);
}

TEST_F(TexturePatternsTest, DirectionsMixByTheAbsoluteCosineOfTheGeometricNormal) {
  DirectionMixTexture mix;
  mix.direction = {0, 0, 1};
  mix.value[0] = {.value = 3};
  mix.value[1] = {.value = 1};
  Add(false, mix);
  Build();
  const auto at = [&](Vec3f n) {
    TexturePoint point{.uv = {}, .p_world = {}};
    point.ng = n;
    return FloatAt(point);
  };
  EXPECT_EQ(at({0, 0, 1}), 3);
  EXPECT_EQ(at({0, 0, -1}), 3);
  EXPECT_EQ(at({1, 0, 0}), 1);
  EXPECT_FLOAT_EQ(at({0.8f, 0, -0.6f}), 1 + 2 * 0.6f);
}

TEST_F(TexturePatternsTest, BilerpHasItsValuesAtTheCornersAndTheirMeanBetween) {
  BilerpTexture bilerp;
  for (size_t i = 0; i < 4; ++i) {
    bilerp.color[i].rgb = Rgb{0.1f, 0.2f, 0.3f} * static_cast<float>(i);
    bilerp.value[i] = static_cast<float>(i);
  }
  Add(true, bilerp);
  Build();
  const auto at = [&](float u, float v) { return ColorAt({.uv = {u, v}, .p_world = {}}).g; };
  EXPECT_EQ(at(0, 0), 0);
  EXPECT_FLOAT_EQ(at(1, 0), 0.2f);
  EXPECT_FLOAT_EQ(at(0, 1), 0.4f);
  EXPECT_FLOAT_EQ(at(1, 1), 0.6f);
  EXPECT_FLOAT_EQ(at(0.5f, 0.5f), 0.3f);
  EXPECT_FLOAT_EQ(at(2, 0), 0.4f);  // Linear beyond the square, too.
}

// Without noise, marble is its curve of colors over the sine of y.
TEST_F(TexturePatternsTest, MarbleIsACurveOfColors) {
  MarbleTexture marble;
  marble.scale = 2;
  marble.variation = 0;
  Add(true, marble);
  Build();
  const auto at = [&](double y) { return ColorAt({.uv = {}, .p_world = {7, y, 9}}); };
  // sin(2 y) = -1 is the begin of the first segment, whose control points begin with this color.
  const Rgb begin = at(-0.25 * kPi);
  EXPECT_FLOAT_EQ(begin.r, 1.5f * 0.58f);
  EXPECT_FLOAT_EQ(begin.b, 1.5f * 0.6f);
  // sin(2 y) = 0 is the begin of the fourth.
  EXPECT_FLOAT_EQ(at(0).g, 1.5f * 0.5f);
  EXPECT_EQ(at(1).r, at(1 + kPi).r);
}

TEST_F(TexturePatternsTest, BadPlacesGiveNumbers) {
  const double nan = std::nan("");
  Add(true, MarbleTexture{});
  Build();
  EXPECT_TRUE(std::isfinite(ColorAt({.uv = {}, .p_world = {nan, nan, nan}}).r));
  scene_.textures.clear();
  DotsTexture dots;
  dots.value[0] = {.value = 1};
  Add(false, dots);
  Build();
  const auto bad = static_cast<float>(nan);
  EXPECT_EQ(FloatAt({.uv = {bad, bad}, .p_world = {}}), 0);
}

// The step for slopes is small beside a cell of the finest octave, and large beside rounding.
TEST_F(TexturePatternsTest, SlopesOfNoiseAreThoseOfItsFinestOctave) {
  Matrix4 texture_from_world;
  for (size_t i = 0; i < 3; ++i) texture_from_world.m[i][i] = 10;
  Add(false, NoiseTexture{.octaves = 8, .texture_from_world = texture_from_world});
  Build();
  const FloatOperand operand{.texture = 0};
  const auto scale = program_->SlopeScaleOf(operand);
  for (const Vec3d p : kPlaces) {
    const Vec3d dpdu{3, 0, 0}, dpdv{0, 0.5, 0};
    const Vec2d step = program_->SlopeStep(scale, {.uv = {}, .p_world = p}, dpdu, dpdv);
    const auto slope = [&](double h, const auto& height) {
      return (height(p + dpdu * h) - height(p - dpdu * h)) / (2 * h);
    };
    const double found = slope(
        step.x, [&](Vec3d q) { return static_cast<double>(FloatAt({.uv = {}, .p_world = q})); });
    const double expected = slope(1e-7, [&](Vec3d q) { return FractalNoise(10 * q, 8, 0.5); });
    EXPECT_NEAR(found, expected, 2);  // Each of the octaves has slopes of about 30.
    EXPECT_NEAR(step.y, 6 * step.x, 1e-9);
  }
}

}  // namespace
}  // namespace sheaf::render
