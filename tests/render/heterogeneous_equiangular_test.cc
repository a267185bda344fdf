// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Equiangular sampling in heterogeneous media: against quadrature, against homogeneous media, in a
// furnace, with all variants and tile by tile. techniques_test.cc tests the agreement of
// techniques. The tolerance of means is ExpectMean's 5 standard errors, or 5 standard errors of the
// difference of two images.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "common/math/elementary.h"
#include "gtest/gtest.h"
#include "tests/support/long_tests.h"
#include "tests/support/test_scene.h"
#include "worker/render/sampling/event_stream.h"

namespace sheaf::render {
namespace {

constexpr EquiangularMode kEveryDecision[] = {EquiangularMode::kWhereEfficient,
                                              EquiangularMode::kAlways, EquiangularMode::kNever};

CompiledScenePtr CompileWith(const TestScene& t, const FrameSettings& settings,
                             EquiangularMode lines) {
  TableFileSource files({});
  auto compiled = CompileScene(t.scene, settings, files, {}, {.equiangular_mode = lines});
  EXPECT_TRUE(compiled.ok()) << compiled.status();
  return *std::move(compiled);
}
FilmTile RenderWith(const TestScene& t, const FrameSettings& settings, EquiangularMode lines) {
  RenderStats stats;
  FilmTile film = RenderAll(*CompileWith(t, settings, lines), &stats);
  EXPECT_EQ(stats.broken_nestings, 0u);
  EXPECT_EQ(stats.broken_majorants, 0u);
  return film;
}

// Fills the cube of half-size 0.8 with a medium: density times sigma over the cube from -1 to 1, or
// a constant without a density.
void Fill(TestScene* t, std::vector<float> density, Rgb sigma_a, Rgb sigma_s, float g = 0) {
  MediumDescription medium;
  medium.sigma_a.rgb = sigma_a;
  medium.sigma_s.rgb = sigma_s;
  medium.g = g;
  if (!density.empty()) {
    const auto side = static_cast<int32_t>(std::lround(std::cbrt(density.size())));
    UniformGridMedium grid;
    grid.box = {{side, side, side}, {-1, -1, -1}, {1, 1, 1}};
    grid.density = std::move(density);
    medium.kind = std::move(grid);
  }
  t->AddShape(MeshShape{t->Box({-0.8f, -0.8f, -0.8f}, {0.8f, 0.8f, 0.8f})},
              t->AddMaterial(InterfaceMaterial{}))
      .media.inside = static_cast<int32_t>(t->scene.media.size());
  t->scene.media.push_back(std::move(medium));
}
std::vector<float> Even() { return std::vector<float>(40 * 40 * 40, 1.0f); }
std::vector<float> EquiangularLumps() {
  EventStream random({1, 2, 3, 4});
  std::vector<float> values(20 * 20 * 20);
  for (float& v : values) {
    const double u = random.Uniform();
    v = u < 0.4 ? 0.0f : static_cast<float>(4 * u * u * u);
  }
  return values;
}

void AddPoint(TestScene* t, Vec3d from, Rgb intensity) {
  PointLight light;
  light.intensity.rgb = intensity;
  light.from = from;
  t->scene.lights.push_back({light, {}, {}, {}});
}
void AddBall(TestScene* t, Vec3d at, float radius, Rgb radiance) {
  t->AddShape(SphereShape{radius, -radius, radius, 360}, t->Diffuse({}), TranslateMatrix(at))
      .area_light = t->AreaLight(radiance);
}

void ExpectEqualMeans(const TileMean& a, const TileMean& b) {
  for (size_t c = 0; c < 3; ++c) {
    const double error = std::hypot(a.standard_error[c], b.standard_error[c]);
    EXPECT_NEAR(a.mean[c], b.mean[c], 5 * error) << c;
    EXPECT_LT(error, 0.03 * std::max<double>(b.mean[c], 0.02)) << c;
  }
}

// V7: light from a point light that one ray gathers in a grid of one value, for each color, against
// the integral of e^(-sigma (t + d)) / d^2 over the grid's part of the ray.
TEST(HeterogeneousEquiangularTest, V7AirlightInAConstantGrid) {
  constexpr double kIntensity = 3, kAlong = 0.1, kEnd = 0.8;
  for (const float scale : {1e-3f, 0.3f, 3.0f}) {
    for (const double height : {1e-3, 0.5}) {
      SCOPED_TRACE(::testing::Message() << scale << " " << height);
      const Rgb sigma_a = Rgb{0.1f, 0.2f, 0.3f} * scale, sigma_s = Rgb{2, 1, 0.5f} * scale;
      TestScene t({0, 0, -2}, {0, 0, 0}, 1e-4f);
      Fill(&t, Even(), sigma_a, sigma_s);
      AddPoint(&t, {0, height, kAlong}, Rgb::Gray(static_cast<float>(kIntensity)));
      const double first = std::atan2(-kEnd - kAlong, height),
                   last = std::atan2(kEnd - kAlong, height);
      constexpr int kSteps = 1 << 14;
      Rgb expected;
      for (size_t c = 0; c < 3; ++c) {
        const double sigma = double{sigma_a[c]} + double{sigma_s[c]};
        double sum = 0;
        for (int i = 0; i < kSteps; ++i) {
          const double angle = first + (last - first) * (i + 0.5) / kSteps;
          const double along = kAlong + kEnd + height * std::tan(angle);
          sum += std::exp(-sigma * (along + height / std::cos(angle)));
        }
        expected[c] = static_cast<float>(kIntensity * double{sigma_s[c]} / (4 * kPi) * sum *
                                         (last - first) / kSteps / height);
      }
      const FrameSettings settings = SquareSettings(4, DrawCount(1024, 1 << 16), 1);
      for (const EquiangularMode lines :
           {EquiangularMode::kAlways, EquiangularMode::kWhereEfficient}) {
        const TileMean mean = MeanOf(RenderWith(t, settings, lines));
        ExpectMean(mean, expected);
        // Distance samples alone would leave errors of tens of percent in thin media.
        for (size_t c = 0; c < 3 && scale < 1; ++c) {
          EXPECT_LT(mean.standard_error[c], 0.02 * double{expected[c]}) << c;
        }
      }
    }
  }
}

// V7: a grid of one value equals the homogeneous medium, lit from inside and from outside, by a
// point light and by an area light, with any number of scatterings, in RGB and spectral transport.
TEST(HeterogeneousEquiangularTest, V7ConstantGridEqualsAHomogeneousMedium) {
  const Rgb sigma_a{0.1f, 0.2f, 0.4f}, sigma_s{1.5f, 0.8f, 0.4f};
  const auto lit = [&](bool from_within, bool by_point, bool is_grid) {
    TestScene t({0.2, 0.6, -2.5}, {0, 0, 0}, 30);
    Fill(&t, is_grid ? Even() : std::vector<float>(), sigma_a, sigma_s, 0.4f);
    const Vec3d at = from_within ? Vec3d{0.2, 0.1, 0.3} : Vec3d{0.4, 1.3, 0.2};
    // Point lights are outside, so that 1 / distance^2 is bounded at the distance samples.
    if (by_point) AddPoint(&t, at, {0.5f, 0.6f, 0.7f});
    if (!by_point) AddBall(&t, at, 0.25f, {3, 4, 5});
    return t;
  };
  for (const ColorTransport color : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
    FrameSettings settings = SquareSettings(16, DrawCount(256, 4096), 16);
    settings.color = color;
    for (const auto& [within, point] : {std::pair{false, true}, {true, false}, {false, false}}) {
      SCOPED_TRACE(::testing::Message() << within << " " << point);
      const TileMean expected =
          MeanOf(RenderWith(lit(within, point, false), settings, EquiangularMode::kWhereEfficient));
      for (const EquiangularMode lines : kEveryDecision) {
        ExpectEqualMeans(MeanOf(RenderWith(lit(within, point, true), settings, lines)), expected);
      }
    }
  }
}

// V12: inside a surrounding emitter, media without absorption return all incident light.
TEST(HeterogeneousEquiangularTest, V12FurnaceWithALocalLightStaysWhite) {
  for (const EquiangularMode lines : kEveryDecision) {
    for (const float g : {0.0f, 0.6f}) {
      TestScene t({0.2, 0.6, -2.5}, {0, 0, 0}, 30);
      t.AddShape(SphereShape{5, -5, 5, 360}, t.Diffuse({})).area_light =
          t.AreaLight(Rgb::Gray(1), true);
      Fill(&t, EquiangularLumps(), {}, {4, 2, 0.5f}, g);
      const FrameSettings settings = SquareSettings(16, DrawCount(128, 2048), 1 << 20);
      ExpectMean(MeanOf(RenderAll(*CompileWith(t, settings, lines))), Rgb::Gray(1));
    }
  }
}

TestScene Cloud(float scale, Vec3d light) {
  TestScene t({0.2, 0.6, -2.5}, {0, 0, 0}, 40);
  Fill(&t, EquiangularLumps(), Rgb{0.1f, 0.2f, 0.4f} * scale, Rgb{1.5f, 0.8f, 0.4f} * scale, 0.4f);
  t.AddShape(MeshShape{t.Quad({-2, -1, -2}, {-2, -1, 2}, {2, -1, 2}, {2, -1, -2})},
             t.Diffuse({0.5f, 0.4f, 0.3f}));
  AddPoint(&t, light, {0.5f, 0.6f, 0.7f});
  return t;
}

TEST(HeterogeneousEquiangularTest, EveryVariantAndTileGivesTheSameBits) {
  const TestScene t = Cloud(0.5f, {0.2, 0.3, 0.1});
  for (const EquiangularMode lines : kEveryDecision) {
    FrameSettings settings = SquareSettings(16, 16, 6);
    const CompiledScenePtr scene = CompileWith(t, settings, lines);
    const FilmTile whole = RenderAll(*scene);
    settings.force_generic_variant = true;
    EXPECT_TRUE(whole == RenderWith(t, settings, lines));
    EXPECT_EQ(PlanOf(*scene).variant_name, "cloud");
    const auto right = RenderTilePass(*scene, {8, 4, 16, 16}, {0, 16}, {}, nullptr);
    ASSERT_TRUE(right.ok());
    for (int32_t y = 4; y < 16; ++y) {
      for (int32_t x = 8; x < 16; ++x) {
        EXPECT_EQ(right->channel(FilmChannel::kRedHi)[(y - 4) * 8 + x - 8],
                  whole.channel(FilmChannel::kRedHi)[y * 16 + x]);
      }
    }
  }
}

// Segments are not sampled if it does not pay off: in dense media lit from afar, and for lights at
// infinity.
TEST(HeterogeneousEquiangularTest, InefficientSegmentsUseDistanceSamplingOnly) {
  const FrameSettings settings = SquareSettings(16, 4, 6);
  TestScene sky({0.2, 0.6, -2.5}, {0, 0, 0}, 40);
  Fill(&sky, EquiangularLumps(), {}, Rgb::Gray(0.5f));
  sky.ConstantEnvironment(Rgb::Gray(1));
  const auto is_without = [&](const TestScene& t) {
    return RenderWith(t, settings, EquiangularMode::kWhereEfficient) ==
           RenderWith(t, settings, EquiangularMode::kNever);
  };
  EXPECT_TRUE(is_without(sky));
  EXPECT_TRUE(is_without(Cloud(20, {3, 4, 1})));
  EXPECT_FALSE(is_without(Cloud(0.5f, {3, 4, 1})));
  EXPECT_FALSE(is_without(Cloud(5, {0.2, 0.3, 0.1})));
}

}  // namespace
}  // namespace sheaf::render
