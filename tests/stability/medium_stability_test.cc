// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of participating media, named as in the catalogue (V1, V2, V6, V8 to V13, G12). The
// tolerance of means is ExpectMean's 5 standard errors unless stated otherwise.
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "common/math/elementary.h"
#include "gtest/gtest.h"
#include "tests/support/fog_scene.h"
#include "tests/support/hard_case.h"
#include "tests/support/long_tests.h"
#include "tests/support/naive_geometry.h"
#include "tests/support/naive_media.h"
#include "tests/support/test_scene.h"
#include "worker/render/medium/medium_set.h"

namespace sheaf::render {
namespace {

struct Rendered {
  TileMean mean;
  FilmTile film;
  uint64_t broken = 0;
};
Rendered RenderFog(const SceneDescription& scene, const FrameSettings& settings) {
  const CompiledScenePtr compiled = Compile(scene, settings);
  RenderStats stats;
  FilmTile film = RenderAll(*compiled, &stats);
  TileMean mean = MeanOf(film);
  return {mean, std::move(film), stats.broken_nestings};
}
TileMean ExpectFog(const FogScene& t, const FrameSettings& settings, Rgb expected) {
  const Rendered rendered = RenderFog(t.scene, settings);
  ExpectMean(rendered.mean, expected);
  EXPECT_EQ(rendered.broken, 0u);
  return rendered.mean;
}
FrameSettings Spectral(FrameSettings settings) {
  settings.color = ColorTransport::kSpectral;
  return settings;
}

// V1: the light that a half-space of isotropic scatterers under a constant sky reflects into a
// direction is its plane albedo, for every density. Values: Chandrasekhar's H functions. The box is
// many thousand times as deep and wide as light diffuses. The camera is close: rays start at
// rounded points, whose resolution must be finer than a free path.
FogScene HalfSpace(double mu, float albedo, float density) {
  const double height = 0.05;
  const double side = height * std::sqrt(1 - mu * mu) / mu;
  FogScene t({side, height, 0}, {0, 0, 0}, 0.01f, {0, 0, 1});
  t.ConstantEnvironment(Rgb::Gray(1));
  const int32_t fog = t.AddMedium(Rgb::Gray((1 - albedo) * density), Rgb::Gray(albedo * density));
  const float size = 1000 + 4e4f / density;
  t.FillBox({-size, -size, -size}, {size, 0, size}, fog);
  return t;
}

TEST(MediumStability, V1HalfSpaceHasItsPlaneAlbedo) {
  struct Row {
    float albedo;
    double from_above, at_half;
  };
  for (const Row& row :
       {Row{0.5f, .115226, .160144}, Row{0.8f, .285255, .367970}, Row{0.9f, .414947, .507939},
        Row{0.99f, .752721, .815140}, Row{0.999f, .912845, .938061}}) {
    SCOPED_TRACE(row.albedo);
    const FrameSettings settings = SquareSettings(8, DrawCount(256, 4096), 1 << 20);
    ExpectFog(HalfSpace(1, row.albedo, 1), settings, Rgb::Gray(static_cast<float>(row.from_above)));
    ExpectFog(HalfSpace(0.5, row.albedo, 1), settings, Rgb::Gray(static_cast<float>(row.at_half)));
  }
}

TEST(MediumStability, V1AlbedoDoesNotDependOnDensity) {
  for (const float density : {1.0f, 1e2f, 1e4f, 1e6f}) {
    SCOPED_TRACE(density);
    const TileMean mean =
        ExpectFog(HalfSpace(1, 0.9f, density), SquareSettings(8, DrawCount(512, 8192), 1 << 20),
                  Rgb::Gray(.414947f));
    if (density < 1e6f) continue;
    ExpectHardCase({.row = "V1",
                    .figure = "albedo of a half space of density 10^6",
                    .expected = .414947,
                    .measured = mean.mean.g,
                    .standard_error = mean.standard_error.g,
                    .tolerance = 1e-6,
                    .naive = naive::WeightOfFlight(0.9f * density, density, 1),
                    .naive_by = "weight T sigma_s / (sigma_t T) over a unit length"});
  }
}

// V2: the fraction of the light behind a thin slab that the slab absorbs (DistanceSamplingStability
// tests the scattered light).
TEST(MediumStability, V2ThinMediaAbsorbLittle) {
  for (const float thickness : {1e-8f, 1e-6f, 1e-4f, 1e-2f}) {
    SCOPED_TRACE(thickness);
    FogScene t({0, 0, -2}, {0, 0, 0}, 0.01f);
    t.ConstantEnvironment(Rgb::Gray(1));
    const int32_t fog = t.AddMedium(Rgb::Gray(thickness), {});
    t.FillBox({-3, -3, -0.5f}, {3, 3, 0.5f}, fog);
    ExpectFog(t, SquareSettings(4, 16, 8),
              Rgb::Gray(static_cast<float>(std::exp(-static_cast<double>(thickness)))));
  }
}

// V6: infinite absorbing fog transmits nothing, whether it scatters or not.
TEST(MediumStability, V6InfiniteFog) {
  for (const bool scatters : {false, true}) {
    FogScene t({0, 0, 0}, {0, 0, 1}, 40);
    t.ConstantEnvironment(Rgb::Gray(1));
    t.scene.camera.medium = t.AddMedium(Rgb::Gray(0.01f), scatters ? Rgb::Gray(0.01f) : Rgb{});
    ExpectFog(t, SquareSettings(4, 16, 100), {});
  }
}

// V9: a camera inside emissive fog sees Le / sigma_a (1 - e^-(sigma_a s)) of it in front of a wall.
TEST(MediumStability, V9CameraInFog) {
  for (const double distance : {1e-3, 1.0, 300.0}) {
    SCOPED_TRACE(distance);
    const auto z = static_cast<float>(distance);
    FogScene t({0, 0, 0}, {0, 0, 1}, 0.01f);
    t.scene.camera.medium = t.AddMedium({0.5f, 1, 2}, {}, 0, {3, 2, 1});
    t.AddShape(MeshShape{t.Quad({-9, -9, z}, {-9, 9, z}, {9, 9, z}, {9, -9, z})}, t.Diffuse({}));
    Rgb expected;
    for (size_t c = 0; c < 3; ++c) {
      const double sigma = std::array{0.5, 1.0, 2.0}[c], radiance = std::array{3.0, 2.0, 1.0}[c];
      expected[c] = static_cast<float>(radiance * -std::expm1(-sigma * distance));
    }
    const TileMean mean = ExpectFog(t, SquareSettings(4, 16, 5), expected);
    if (distance > 1) continue;
    ExpectHardCase({.row = "V9",
                    .figure = distance < 1 ? "radiance of a thousandth of fog around the camera"
                                           : "radiance of a unit of fog around the camera",
                    .expected = expected.r,
                    .measured = mean.mean.r,
                    .standard_error = mean.standard_error.r,
                    .tolerance = 4 * 0x1p-23 * static_cast<double>(expected.r),
                    .naive = 3 * naive::Taken(0.5f * static_cast<float>(distance)),
                    .naive_by = "1 - e^-x"});
  }
}

// V7: light of a point light that fog scatters once towards the camera, against the integral of
// e^(-sigma (t + d)) / d^2: lights at any height above the ray, fog of any density.
TEST(MediumStability, V7Airlight) {
  struct Row {
    float height, sigma, wall;
  };
  for (const Row& row : {Row{1, 0.1f, 8}, Row{1e-2f, 0.1f, 8}, Row{1e-4f, 1e-4f, 8},
                         Row{1, 1e-6f, 1e3f}, Row{0.5f, 4, 8}}) {
    SCOPED_TRACE(::testing::Message() << row.height << " " << row.sigma);
    constexpr double kAlong = 4, kIntensity = 3;
    FogScene t({0, 0, 0}, {0, 0, 1}, 1e-4f);
    t.scene.camera.medium = t.AddMedium(Rgb::Gray(0.25f * row.sigma), Rgb::Gray(0.75f * row.sigma));
    const float z = row.wall;
    t.AddShape(MeshShape{t.Quad({-9, -9, z}, {-9, 9, z}, {9, 9, z}, {9, -9, z})}, t.Diffuse({}));
    PointLight light;
    light.intensity.rgb = Rgb::Gray(kIntensity);
    light.from = {0, row.height, kAlong};
    t.scene.lights.push_back({light, {}, {}, {}});
    // Integrated over the angle at the light, in which the integrand is smooth.
    const double h = static_cast<double>(row.height), sigma = static_cast<double>(row.sigma);
    const double first = std::atan2(-kAlong, h), last = std::atan2(double{z} - kAlong, h);
    constexpr int kSteps = 1 << 16;
    double sum = 0;
    for (int i = 0; i < kSteps; ++i) {
      const double angle = first + (last - first) * (i + 0.5) / kSteps;
      const double along = kAlong + h * std::tan(angle), distance = h / std::cos(angle);
      sum += std::exp(-sigma * (along + distance));
    }
    const double expected =
        kIntensity * 0.75 * sigma / (4 * kPi) * sum * (last - first) / kSteps / h;
    const Rendered rendered = RenderFog(t.scene, SquareSettings(4, DrawCount(1024, 1 << 16), 1));
    ExpectMean(rendered.mean, Rgb::Gray(static_cast<float>(expected)));
    // Distance samples alone would leave errors of tens of percent here.
    EXPECT_LT(rendered.mean.standard_error[0], 2e-3 * expected);
  }
}

// V10: an emissive slab has L = Le (1 - e^-tau), for tau from 1e-6 to 1e3, in RGB and in spectral
// transport.
TEST(MediumStability, V10EmissiveSlab) {
  for (const double tau : {1e-6, 1e-3, 1.0, 30.0, 1e3}) {
    SCOPED_TRACE(tau);
    FogScene t({0, 0, -2}, {0, 0, 0}, 0.01f);
    const int32_t fire = t.AddMedium(Rgb::Gray(static_cast<float>(tau)), {}, 0, {4, 2, 1});
    t.FillBox({-3, -3, -0.5f}, {3, 3, 0.5f}, fire);
    const auto fraction = static_cast<float>(-std::expm1(-tau));
    const TileMean mean = ExpectFog(t, SquareSettings(4, 16, 5), Rgb{4, 2, 1} * fraction);
    if (tau == 1e-6) {
      ExpectHardCase({.row = "V10",
                      .figure = "radiance of a slab of thickness 1e-6 that emits 4",
                      .expected = 4 * -std::expm1(-tau),
                      .measured = mean.mean.r,
                      .standard_error = mean.standard_error.r,
                      .tolerance = 1e-6 * 4e-6,
                      .naive = 4 * naive::Taken(1e-6f),
                      .naive_by = "1 - e^-tau"});
    }
    const Rendered spectral =
        RenderFog(t.scene, Spectral(SquareSettings(4, DrawCount(1024, 1 << 16), 5)));
    for (size_t c = 0; c < 3; ++c) {
      const float expected = Rgb{4, 2, 1}[c];
      EXPECT_NEAR(spectral.mean.mean[c] / fraction, expected,
                  5 * spectral.mean.standard_error[c] / fraction + 0.01);
    }
  }
}

// V11: each component is attenuated by its own coefficient.
TEST(MediumStability, V11ChromaticAbsorption) {
  FogScene t({0, 0, -2}, {0, 0, 0}, 0.01f);
  t.ConstantEnvironment(Rgb::Gray(1));
  t.FillBox({-3, -3, -0.5f}, {3, 3, 0.5f}, t.AddMedium({1, 10, 100}, {}));
  const TileMean mean = RenderFog(t.scene, SquareSettings(4, 16, 5)).mean;
  EXPECT_EQ(mean.non_finite, 0u);
  for (size_t c = 0; c < 3; ++c) {
    // Lengths equal the tracer's distances up to a few float roundings.
    const double tau = std::pow(10.0, static_cast<double>(c)), left = std::exp(-tau);
    EXPECT_NEAR(mean.mean[c], left, left * (1 + tau) * 1e-6 + 1e-40);
  }
}

// V11, V12: purely scattering media are invisible under a constant sky, for every color and phase
// function, thin or thick, and with overlaps.
TEST(MediumStability, V12WhiteFurnace) {
  struct Case {
    Rgb sigma_s;
    float g;
  };
  for (const Case& c :
       {Case{Rgb::Gray(1), 0}, Case{Rgb::Gray(1e-3f), 0.5f}, Case{Rgb::Gray(8), 0.9f},
        Case{Rgb::Gray(3), -0.7f}, Case{{1, 3, 9}, 0}, Case{{0.1f, 1, 10}, 0.8f}}) {
    for (const bool spectral : {false, true}) {
      SCOPED_TRACE(c.sigma_s.b);
      FogScene t({0, 0, -4}, {0, 0, 0}, 30);
      t.ConstantEnvironment(Rgb::Gray(1));
      t.Fill(SphereShape{1, -1, 1, 360}, t.AddMedium({}, c.sigma_s, c.g));
      FrameSettings settings = SquareSettings(8, DrawCount(128, 2048), 1 << 20);
      if (spectral) settings = Spectral(settings);
      const Rendered rendered = RenderFog(t.scene, settings);
      EXPECT_EQ(rendered.mean.non_finite, 0u);
      EXPECT_EQ(rendered.broken, 0u);
      for (size_t i = 0; i < 3; ++i) {
        EXPECT_NEAR(rendered.mean.mean[i], 1, 5 * rendered.mean.standard_error[i] + 5e-4);
      }
      if (c.sigma_s.r != 8 || spectral) continue;
      ExpectHardCase({.row = "V12",
                      .figure = "furnace of a ball that only scatters",
                      .expected = 1,
                      .measured = rendered.mean.mean.g,
                      .standard_error = rendered.mean.standard_error.g,
                      .tolerance = 5e-4,
                      .naive = naive::FurnaceThroughput(8, 100000),
                      .naive_by = "10^5 products of T sigma / pdf"});
    }
  }
}

// G12: transmittance of two boxes, one inside the other and replacing its medium.
TEST(MediumStability, G12NestedBoxes) {
  FogScene t({0.1, 0.2, -4}, {0, 0, 0}, 0.01f);
  t.ConstantEnvironment(Rgb::Gray(1));
  const int32_t thin = t.AddMedium(Rgb::Gray(0.5f), {}), thick = t.AddMedium(Rgb::Gray(2), {});
  t.FillBox({-9, -9, -1}, {9, 9, 1}, thin);
  t.FillBox({-8, -8, -0.25f}, {8, 8, 0.25f}, thick, thin);  // The path leaves thin while in thick.
  const double unit = std::sqrt(0.05 + 16) / 4;
  const Rendered rendered = RenderFog(t.scene, SquareSettings(2, 16, 5));
  EXPECT_EQ(rendered.broken, 0u);
  ExpectHardCase({.row = "G12",
                  .figure = "transmittance of a box within a box",
                  .expected = std::exp(-unit * (0.5 * 1.5 + 2 * 0.5)),
                  .measured = rendered.mean.mean.g,
                  .tolerance = 1e-5,
                  .naive = naive::TransmittanceWithoutExit(0.5f),
                  .naive_by = "the exit missed, the medium kept"});
}

// Closed volumes whose surfaces declare an infinite medium inside them: paths that reach it end,
// and are counted.
TEST(MediumStability, G12BrokenNestingIsCounted) {
  FogScene t({0, 0, -4}, {0, 0, 0}, 0.01f);
  t.ConstantEnvironment(Rgb::Gray(1));
  const int32_t fog = t.AddMedium({}, Rgb::Gray(1));
  t.FillBox({5, 5, 5}, {6, 6, 6}, fog);
  t.FillBox({-1, -1, -1}, {1, 1, 1}, t.AddMedium({}, {}), fog);
  const Rendered rendered = RenderFog(t.scene, SquareSettings(2, 16, 5));
  ExpectMean(rendered.mean, {});
  EXPECT_GE(rendered.broken, 64u);
}

TEST(MediumStability, V8MediumSetIsAMultiset) {
  MediumSet set;
  for (const uint16_t medium : std::vector<uint16_t>{7, 3, 7, 5}) EXPECT_TRUE(set.Add(medium));
  EXPECT_EQ(std::vector<uint16_t>(set.begin(), set.end()), (std::vector<uint16_t>{3, 5, 7, 7}));
  EXPECT_TRUE(set.Remove(7));
  EXPECT_FALSE(set.Remove(4));
  EXPECT_EQ(std::vector<uint16_t>(set.begin(), set.end()), (std::vector<uint16_t>{3, 5, 7}));
  MediumSet two;
  for (const uint16_t medium : {uint16_t{3}, uint16_t{5}}) EXPECT_TRUE(two.Add(medium));
  EXPECT_TRUE(two.Remove(3));
  ExpectHardCase({.row = "V8",
                  .figure = "medium after 3 and 5 were entered and 3 was left",
                  .expected = 5,
                  .measured = two.size() == 1 ? *two.begin() : 0,
                  .naive = naive::MediumAfterLeaving({3, 5}),
                  .naive_by = "the top of a stack"});
  while (set.size() < kMediaAtOnceMax) EXPECT_TRUE(set.Add(1));
  EXPECT_FALSE(set.Add(9));
  EXPECT_EQ(set.size(), kMediaAtOnceMax);
}

// V8: overlapping media add up, whatever the order of entering and of the file.
FogScene Overlap(bool twice, bool swapped) {
  FogScene t({0.3, 0.4, -5}, {0, 0, 0}, 35);
  t.ConstantEnvironment({1, 0.5f, 0.2f});
  t.AddShape(MeshShape{t.Quad({-9, -2, -9}, {-9, -2, 9}, {9, -2, 9}, {9, -2, -9})},
             t.Diffuse(Rgb::Gray(0.5f)));
  if (!twice) {
    t.FillBox({-1, -1, -1}, {1, 1, 1}, t.AddMedium({0.5f, 0.25f, 1}, {2, 1, 0.5f}, 0.5f));
    return t;
  }
  const Rgb sigma_a[2] = {{0.25f, 0.125f, 0.75f}, {0.25f, 0.125f, 0.25f}};
  const Rgb sigma_s[2] = {{0.5f, 0.5f, 0.25f}, {1.5f, 0.5f, 0.25f}};
  const int first = swapped ? 1 : 0;
  const int32_t one = t.AddMedium(sigma_a[first], sigma_s[first], 0.5f);
  const int32_t other = t.AddMedium(sigma_a[1 - first], sigma_s[1 - first], 0.5f);
  const int32_t a = swapped ? other : one, b = swapped ? one : other;
  t.FillBox({-1, -1, -1}, {1, 1, 1}, a);
  t.FillBox({-1, -1, -1}, {1, 1, 1}, b);
  return t;
}

TEST(MediumStability, V8OverlappingVolumesAddUp) {
  const FrameSettings settings = SquareSettings(12, 256, 20);
  const Rendered one = RenderFog(Overlap(false, false).scene, settings);
  const Rendered two = RenderFog(Overlap(true, false).scene, settings);
  const Rendered swapped = RenderFog(Overlap(true, true).scene, settings);
  EXPECT_EQ(two.broken, 0u);
  EXPECT_TRUE(two.film == swapped.film);
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(one.mean.mean[c], two.mean.mean[c],
                5 * std::hypot(one.mean.standard_error[c], two.mean.standard_error[c]) + 1e-6);
  }
}

// V13: a scene rotated as a whole keeps its image, also with many almost straight scatterings.
FogScene Turned(double degrees, Vec3d axis) {
  const Matrix4 turn = RotateMatrix(degrees, axis);
  const auto at = [&turn](Vec3d p) { return TransformPoint(turn, p); };
  FogScene t(at({0, 0, -4}), at({0, 0, 0}), 30, at({0, 1, 0}));
  const int32_t fog = t.AddMedium(Rgb::Gray(0.05f), Rgb::Gray(20), 0.98f);
  t.Fill(SphereShape{1, -1, 1, 360}, fog);
  DistantLight sun;
  sun.radiance.rgb = Rgb::Gray(3);
  sun.from = at({0.5, 1, 1});
  sun.to = {0, 0, 0};
  t.scene.lights.push_back({sun, {}, {}, {}});
  return t;
}

TEST(MediumStability, V13RotationInvariance) {
  const FrameSettings settings = SquareSettings(8, DrawCount(512, 8192), 1000);
  const Rendered straight = RenderFog(Turned(0, {0, 1, 0}).scene, settings);
  EXPECT_GT(straight.mean.mean.g, 0.01f);
  for (const Vec3d axis : {Vec3d{1, 2, 3}, Vec3d{0, 1, 0}, Vec3d{-3, 0.1, 1}}) {
    const Rendered turned = RenderFog(Turned(77, axis).scene, settings);
    EXPECT_EQ(turned.broken, 0u);
    ExpectHardCase(
        {.row = "V13",
         .figure = "mean radiance of fog turned as a whole",
         .expected = straight.mean.mean.g,
         .measured = turned.mean.mean.g,
         .standard_error = std::hypot(turned.mean.standard_error.g, straight.mean.standard_error.g),
         .naive = straight.mean.mean.g * naive::FrameX({0, 0, -1}),
         .naive_by = "frame about (0, 0, -1) by 1 / (1 + z), as a factor"});
  }
}

// G2: a scene 2^20 times as large or small, with coefficients to match, gives the same bits.
TEST(MediumStability, G2ScaleKeepsTheBits) {
  const auto scaled = [](double scale) {
    TestScene room = LitRoom(scale);
    MediumDescription fog;
    fog.sigma_a.rgb = {0.1f, 0.2f, 0.3f};
    fog.sigma_s.rgb = {0.5f, 0.3f, 0.2f};
    fog.scale = static_cast<float>(1 / scale);
    fog.g = 0.4f;
    fog.emits = true;
    fog.radiance.rgb = {0.1f, 0.1f, 0.05f};
    room.scene.media = {fog};
    room.scene.camera.medium = 0;
    return RenderFog(room.scene, SquareSettings(12, 32, 12));
  };
  const Rendered one = scaled(1);
  EXPECT_GT(one.mean.mean.g, 0.01f);
  for (const double scale : {0x1p-20, 0x1p20}) {
    const Rendered other = scaled(scale);
    EXPECT_EQ(other.broken, 0u);
    for (const FilmChannel channel :
         {FilmChannel::kRedHi, FilmChannel::kGreenHi, FilmChannel::kBlueHi}) {
      for (size_t i = 0; i < one.film.plane_size(); ++i) {
        ASSERT_EQ(one.film.channel(channel)[i], other.film.channel(channel)[i]) << scale;
      }
    }
  }
}

// The image's own outputs describe the first event.
TEST(MediumStability, FirstEventIsInTheFog) {
  FogScene t({0, 0, 0}, {0, 0, 1}, 40);
  t.ConstantEnvironment(Rgb::Gray(1));
  t.scene.camera.medium = t.AddMedium({1, 3, 0}, {3, 1, 2});
  const Rendered rendered = RenderFog(t.scene, SquareSettings(4, 4096, 1));
  const FilmTile& film = rendered.film;
  const auto mean = [&film](FilmChannel channel) {
    double sum = 0, weight = 0;
    for (size_t i = 0; i < film.plane_size(); ++i) {
      sum += static_cast<double>(film.channel(channel)[i]);
      weight += static_cast<double>(film.channel(FilmChannel::kWeight)[i]);
    }
    return sum / weight;
  };
  EXPECT_NEAR(mean(FilmChannel::kAlpha), 1, 1e-6);
  EXPECT_NEAR(mean(FilmChannel::kAlbedoR), 0.75, 1e-3);
  EXPECT_NEAR(mean(FilmChannel::kNormalZ), 0, 1e-6);
}

}  // namespace
}  // namespace sheaf::render
