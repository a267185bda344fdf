// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of light transport, named as in the catalogue (A1 to A5, L7, L8, M5, R6 to R8, C2).
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <thread>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/hard_case.h"
#include "tests/support/naive_materials.h"
#include "tests/support/naive_sampling.h"
#include "tests/support/test_scene.h"
#include "worker/render/densities/weights.h"
#include "worker/render/sampling/filter.h"

namespace sheaf::render {
namespace {

// Radiance inside a closed emissive sphere of reflectance rho: Le / (1 - rho) everywhere.
TestScene SphereInterior(float reflectance) {
  TestScene t({0.3, 0.2, 0.1}, {0, 0, 1}, 70);
  ShapeDescription& sphere =
      t.AddShape(SphereShape{1, -1, 1, 360}, t.Diffuse(Rgb::Gray(reflectance)));
  sphere.reverse_orientation = true;
  sphere.area_light = t.AreaLight({1, 2, 0.5f});
  return t;
}

TEST(TransportStability, A1SphereInterior) {
  const TileMean mean = RenderMean(SphereInterior(0.5f).scene, SquareSettings(8, 256, 100000));
  ExpectMean(mean, {2, 4, 1});
  ExpectHardCase({.row = "A1",
                  .figure = "radiance within a sphere that emits 2 and reflects 1/2",
                  .expected = 4,
                  .measured = mean.mean.g,
                  .standard_error = mean.standard_error.g,
                  .tolerance = 16 * 0x1p-23});
}

// A1: a point light of intensity pi at the center: the wall's radiance is rho / (1 - rho).
TEST(TransportStability, A1PointLightAtTheCenter) {
  TestScene t({0.3, 0.2, 0.1}, {0, 0, 1}, 70);
  t.AddShape(SphereShape{1, -1, 1, 360}, t.Diffuse(Rgb::Gray(0.5f))).reverse_orientation = true;
  PointLight light;
  light.intensity.rgb = Rgb::Gray(static_cast<float>(3.14159265358979));
  t.scene.lights.push_back({light, {}, {}, {}});
  ExpectMean(RenderMean(t.scene, SquareSettings(8, 256, 100000)), Rgb::Gray(1));
}

// A sphere of walls with reflectance rho, in which a fraction f of the area is an open port, and a
// point light at its center. Any two points of a sphere see each other equally, so the wall is lit
// as if it were complete: radiosity M E with the multiplier M = rho / (1 - rho (1 - f)), for every
// f.
TEST(TransportStability, A4IntegratingSphereWithAPort) {
  for (const float port : {0.02f, 0.1f, 0.4f}) {
    for (const float reflectance : {0.5f, 0.98f}) {
      TestScene t({0.1, -0.2, 0.3}, {0, 0, -1}, 30);
      SphereShape sphere{1, -1, 1 - 2 * port, 360};
      t.AddShape(sphere, t.Diffuse(Rgb::Gray(reflectance))).reverse_orientation = true;
      PointLight light;
      light.intensity.rgb = Rgb::Gray(static_cast<float>(std::numbers::pi));
      t.scene.lights.push_back({light, {}, {}, {}});
      SCOPED_TRACE(::testing::Message() << "port " << port << ", reflectance " << reflectance);
      const TileMean mean = RenderMean(t.scene, SquareSettings(4, 256, 1 << 20));
      const float expected = reflectance / (1 - reflectance * (1 - port));
      ExpectMean(mean, Rgb::Gray(expected));
      ExpectHardCase({.row = "A4",
                      .figure = "multiplier of a sphere with a port, the largest",
                      .expected = expected,
                      .measured = mean.mean.g,
                      .standard_error = mean.standard_error.g,
                      .tolerance = 4 * 0x1p-23 * static_cast<double>(expected)});
    }
  }
}

// The faces of the cube [-1, 1]^3, each with its inward normal along `axis`, on the side `sign`.
struct Wall {
  size_t axis;
  double sign;
  float reflectance, emission;
};
const Wall kWalls[] = {{0, -1, 0.9f, 0}, {0, 1, 0.2f, 0.1f}, {1, -1, 0.5f, 0},
                       {1, 1, 0.7f, 1},  {2, -1, 0.3f, 0},   {2, 1, 0.6f, 0.5f}};

TestScene UnequalBox() {
  TestScene t({0, 0, 0}, {0, 0, 1}, 90);
  for (const Wall& wall : kWalls) {
    Vec3d n{}, a{}, b{};
    n[wall.axis] = wall.sign;
    a[(wall.axis + 1) % 3] = 1;
    b[(wall.axis + 2) % 3] = wall.sign;
    // Counterclockwise as seen from inside: a x b points outwards, so a is reversed.
    const auto corner = [&](double u, double v) { return ToFloat(n - a * u + b * v); };
    ShapeDescription& shape =
        t.AddShape(MeshShape{t.Quad(corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1))},
                   t.Diffuse(Rgb::Gray(wall.reflectance)));
    if (wall.emission > 0) shape.area_light = t.AreaLight(Rgb::Gray(wall.emission));
  }
  return t;
}

// Mean radiance that leaves the wall, seen as a whole by an orthographic camera at the center.
TileMean MeanOfWall(const Wall& wall) {
  TestScene t = UnequalBox();
  Vec3d at{}, up{};
  at[wall.axis] = wall.sign;
  up[(wall.axis + 1) % 3] = 1;
  t.SetCamera({0, 0, 0}, at, 90, up);
  t.scene.camera.kind = CameraDescription::Kind::kOrthographic;
  return RenderMean(t.scene, SquareSettings(8, 1024, 1 << 20));
}

// Radiosities of six uniformly lit walls: B = M + rho F B, by iteration. F consists of the form
// factors of a cube's opposite and adjacent faces; one of the former and four of the latter sum to
// 1.
std::array<double, 6> EvenRadiosities() {
  constexpr double kOpposite = 0.1998248957, kAdjacent = 0.2000437761;
  std::array<double, 6> radiosity{};
  for (int i = 0; i < 400; ++i) {
    std::array<double, 6> next{};
    for (size_t to = 0; to < 6; ++to) {
      double arriving = 0;
      for (size_t from = 0; from < 6; ++from) {
        if (from == to) continue;
        const bool is_opposite = kWalls[from].axis == kWalls[to].axis;
        arriving += (is_opposite ? kOpposite : kAdjacent) * radiosity[from];
      }
      next[to] = static_cast<double>(kWalls[to].emission) +
                 static_cast<double>(kWalls[to].reflectance) * arriving;
    }
    radiosity = next;
  }
  return radiosity;
}

// A3: objects that reflect and transmit all light are invisible under a constant sky: a white
// corner, an open bowl, glass and a perfect mirror that illuminate each other. For rough ones,
// energy compensation restores the loss of single scattering to the half percent of their tables,
// at each of several bounces.
TEST(TransportStability, A3LosslessObjectsAreInvisible) {
  for (const float roughness : {0.0f, 0.3f}) {
    SCOPED_TRACE(roughness);
    TestScene t({2.4, 2, 2.2}, {0.5, 0.5, 0.5}, 45);
    t.ConstantEnvironment(Rgb::Gray(1));
    const int32_t white = t.Diffuse(Rgb::Gray(1));
    t.AddShape(MeshShape{t.Quad({0, 0, 0}, {0, 0, 3}, {3, 0, 3}, {3, 0, 0})}, white);
    t.AddShape(MeshShape{t.Quad({0, 0, 0}, {3, 0, 0}, {3, 3, 0}, {0, 3, 0})}, white);
    t.AddShape(SphereShape{0.4f, -0.4f, 0, 360}, white, TranslateMatrix({0.5, 1.2, 0.6}));
    DielectricMaterial glass;
    glass.roughness = {{roughness, kNone}, {roughness, kNone}, false};
    t.AddShape(SphereShape{0.4f, -0.4f, 0.4f, 360}, t.AddMaterial(glass),
               TranslateMatrix({0.9, 0.4, 0.9}));
    ConductorMaterial mirror;
    mirror.roughness = glass.roughness;
    mirror.has_reflectance = true;
    mirror.reflectance.value.rgb = Rgb::Gray(1);
    t.AddShape(SphereShape{0.3f, -0.3f, 0.3f, 360}, t.AddMaterial(mirror),
               TranslateMatrix({1.3, 0.9, 0.4}));
    const TileMean mean = RenderMean(t.scene, SquareSettings(16, 128, 4000));
    EXPECT_EQ(mean.non_finite, 0u);
    if (roughness == 0) {
      ExpectMean(mean, Rgb::Gray(1));
      continue;
    }
    ExpectHardCase({.row = "A3",
                    .figure = "mean radiance of an image of lossless things, roughness 0.3",
                    .expected = 1,
                    .measured = mean.mean.g,
                    .standard_error = mean.standard_error.g,
                    .tolerance = 1e-2,
                    .naive = naive::SingleScattering(roughness, {0.8f, 0, 0.6f}),
                    .naive_by = "one bounce off the rough mirror by single scattering"});
  }
}

// The walls of a closed box absorb all the light that they emit; and the mean of each wall is that
// of six uniformly lit walls, up to some percent due to the unevenness of the light on a wall.
TEST(TransportStability, A2ClosedBoxOfUnequalWalls) {
  const std::array<double, 6> even = EvenRadiosities();
  double emitted = 0, absorbed = 0, variance = 0;
  for (size_t i = 0; i < 6; ++i) {
    const TileMean mean = MeanOfWall(kWalls[i]);
    EXPECT_EQ(mean.non_finite, 0u);
    const double emission = static_cast<double>(kWalls[i].emission),
                 reflectance = static_cast<double>(kWalls[i].reflectance);
    const double per_radiance = (1 - reflectance) / reflectance;
    emitted += emission;
    absorbed += (static_cast<double>(mean.mean[0]) - emission) * per_radiance;
    const double error = static_cast<double>(mean.standard_error[0]);
    variance += error * error * per_radiance * per_radiance;
    EXPECT_NEAR(static_cast<double>(mean.mean[0]), even[i], 0.03 * even[i] + 5 * error)
        << "wall " << i;
  }
  ExpectHardCase({.row = "A2",
                  .figure = "power that the walls of a closed box absorb",
                  .expected = emitted,
                  .measured = absorbed,
                  .standard_error = std::sqrt(variance)});
  EXPECT_LT(std::sqrt(variance), 2e-3 * emitted);
}

// R6: at reflectance 0.99 Russian roulette neither loses nor adds energy over hundreds of bounces.
TEST(TransportStability, R6RouletteKeepsEnergy) {
  const TileMean mean = RenderMean(SphereInterior(0.99f).scene, SquareSettings(4, 256, 1 << 30));
  ExpectMean(mean, {100, 200, 50});
  ExpectHardCase({.row = "R6",
                  .figure = "furnace of reflectance 0.99",
                  .expected = 100,
                  .measured = mean.mean.r,
                  .standard_error = mean.standard_error.r,
                  .tolerance = 4 * 0x1p-23 * 100,
                  .naive = naive::FurnaceInBounces(0.99f, 100),
                  .naive_by = "100 bounces without roulette"});
}

// R6: at reflectance 1 survival is certain, so a path continues until the maximum depth.
TEST(TransportStability, R6WhiteWallsReflectEverything) {
  TestScene t = SphereInterior(1);
  const TileMean mean = RenderMean(t.scene, SquareSettings(4, 16, 50));
  ExpectMean(mean, {51, 102, 25.5f});
}

// R8: a light near the wall of a sphere sends half of its power to a spot that one bounce in
// thousands hits, hundreds of times as bright as the rest. In a sphere all of it returns uniformly:
// the opposite wall, at distance d, has the radiance rho / pi (I / d^2 + I rho / (1 - rho)). No
// sample is clamped unless the scene requests it, and then the plan reports that the image is
// biased.
TEST(TransportStability, R8FirefliesAreNotClamped) {
  constexpr double kRho = 0.5, kHeight = 0.05, kAcross = 2 - kHeight;
  TestScene t({0.3, 0.2, 0.1}, {0, 0, 1}, 0.01f);
  t.AddShape(SphereShape{1, -1, 1, 360}, t.Diffuse(Rgb::Gray(kRho))).reverse_orientation = true;
  PointLight light;
  light.intensity.rgb = Rgb::Gray(1);
  light.from = {0, 0, kHeight - 1};
  t.scene.lights.push_back({light, {}, {}, {}});
  FrameSettings settings = SquareSettings(8, 1024, 1 << 20);
  const CompiledScenePtr scene = Compile(t.scene, settings);
  EXPECT_EQ(FormatRenderPlan(PlanOf(*scene)).find("biased"), std::string::npos);
  const FilmTile raw = RenderAll(*scene);
  settings.max_component_value = 1e9f;
  EXPECT_TRUE(RenderAll(*Compile(t.scene, settings)) == raw);
  settings.max_component_value = 1;
  const CompiledScenePtr clamping = Compile(t.scene, settings);
  EXPECT_NE(FormatRenderPlan(PlanOf(*clamping)).find("biased"), std::string::npos);
  const TileMean mean = MeanOf(raw), clamped = MeanOf(RenderAll(*clamping));
  EXPECT_EQ(mean.non_finite, 0u);
  const double expected = kRho / std::numbers::pi * (1 / (kAcross * kAcross) + kRho / (1 - kRho));
  ExpectHardCase({.row = "R8",
                  .figure = "radiance opposite of a light that makes fireflies",
                  .expected = expected,
                  .measured = mean.mean.g,
                  .standard_error = mean.standard_error.g,
                  .tolerance = 1e-4 * expected,
                  .naive = clamped.mean.g,
                  .naive_by = "samples clamped to 1"});
  EXPECT_LT(clamped.mean.g, expected - 5 * static_cast<double>(mean.standard_error.g));
}

// R7: weights of two techniques lie in [0, 1] and sum to 1, for every magnitude, 0 and infinity.
TEST(TransportStability, R7WeightsSumToOneAtAllMagnitudes) {
  std::vector<float> values{0, std::numeric_limits<float>::denorm_min(),
                            std::numeric_limits<float>::max(),
                            std::numeric_limits<float>::infinity()};
  for (int e = -38; e <= 38; ++e) values.push_back(static_cast<float>(std::pow(10.0, e)));
  int wrong = 0, naive_wrong = 0;
  const auto is_wrong = [](float a, float b) {
    return !(a >= 0 && a <= 1 && std::fabs(a + b - 1) <= 2e-7f);
  };
  for (const float f : values) {
    for (const float g : values) {
      const float a = WeightOf(f, g), b = WeightOf(g, f);
      EXPECT_FALSE(is_wrong(a, b)) << f << " " << g;
      wrong += is_wrong(a, b);
      naive_wrong += is_wrong(naive::PowerHeuristic(f, g), naive::PowerHeuristic(g, f));
    }
  }
  ExpectHardCase(
      {.row = "R7",
       .figure = "pairs of " + InWords(values.size()) + " pdfs whose weights do not sum to 1",
       .expected = 0,
       .measured = wrong,
       .naive = naive_wrong,
       .naive_by = "f^2 / (f^2 + g^2)"});
}

// L8: without any light the image is black without errors; a single light is found by both
// techniques.
TEST(TransportStability, L8NoLightIsBlack) {
  TestScene t({0, 0, -3}, {0, 0, 0}, 40);
  t.AddShape(SphereShape{1, -1, 1, 360}, t.Diffuse(Rgb::Gray(0.5f)));
  const TileMean mean = RenderMean(t.scene, SquareSettings(8, 16, 5));
  EXPECT_EQ(mean.mean, Rgb{});
  EXPECT_EQ(mean.non_finite, 0u);
}

// L8: a disk light over a plane: E = pi L sin^2 below its center, and radiance rho E / pi.
TEST(TransportStability, L8OneLightGivesItsClosedForm) {
  TestScene t({0, 0.5, 0}, {0, 0, 0}, 1e-4f, {0, 0, 1});
  t.AddShape(MeshShape{t.Quad({-10, 0, -10}, {-10, 0, 10}, {10, 0, 10}, {10, 0, -10})},
             t.Diffuse(Rgb::Gray(0.5f)));
  // Facing down, radius 1 at height 1: sin^2 = 1 / 2.
  DiskShape disk;
  disk.radius = 1;
  t.AddShape(disk, t.Diffuse({}), TranslateMatrix({0, 1, 0}) * RotateMatrix(90, {1, 0, 0}))
      .area_light = t.AreaLight(Rgb::Gray(4));
  ExpectMean(RenderMean(t.scene, SquareSettings(4, 1024, 1)), Rgb::Gray(0.5f * 4 * 0.5f));
}

// L7: a black environment equals no environment, to the bit.
TEST(TransportStability, L7BlackEnvironmentChangesNothing) {
  const FrameSettings settings = SquareSettings(8, 16, 10);
  TestScene with = SphereInterior(0.5f);
  with.ConstantEnvironment({});
  EXPECT_TRUE(RenderAll(*Compile(with.scene, settings)) ==
              RenderAll(*Compile(SphereInterior(0.5f).scene, settings)));
}

// A5: the same bits for every partition into tiles and blocks, alone or beside other threads.
TEST(TransportStability, A5TilesAndThreadsChangeNoBit) {
  FrameSettings settings = SquareSettings(16, 32, 10);
  const CompiledScenePtr scene = Compile(SphereInterior(0.7f).scene, settings);
  const FilmTile whole = RenderAll(*scene);
  int differing = 0;
  for (const int32_t size : {3, 8}) {
    const std::vector<PixelRect> tiles = CutTiles(settings.window, size);
    std::vector<FilmTile> parts(tiles.size());
    {
      std::vector<std::jthread> threads;
      for (size_t first = 0; first < 2; ++first) {
        threads.emplace_back([&, first] {
          for (size_t i = first; i < tiles.size(); i += 2) {
            // Two passes of half the samples are siblings in the tree.
            auto low = RenderTilePass(*scene, tiles[i], {0, 16}, {}, nullptr);
            auto high = RenderTilePass(*scene, tiles[i], {16, 16}, {}, nullptr);
            if (low.ok() && high.ok()) parts[i] = MergeSiblings(*low, *high);
          }
        });
      }
    }
    for (const FilmTile& part : parts) {
      ASSERT_GT(part.plane_size(), 0u);
      const PixelRect& r = part.rect();
      for (int32_t y = r.y0; y < r.y1; ++y) {
        for (int32_t x = r.x0; x < r.x1; ++x) {
          const size_t in_part = static_cast<size_t>((y - r.y0) * r.Width() + (x - r.x0));
          const size_t in_whole = static_cast<size_t>(y * 16 + x);
          for (size_t c = 0; c < kFilmChannelCount; ++c) {
            const auto channel = static_cast<FilmChannel>(c);
            differing += part.channel(channel)[in_part] != whole.channel(channel)[in_whole];
          }
        }
      }
    }
  }
  std::vector<float> values(whole.channel(FilmChannel::kGreenHi),
                            whole.channel(FilmChannel::kGreenHi) + whole.plane_size());
  const float forwards = naive::Sum(values);
  std::reverse(values.begin(), values.end());
  ExpectHardCase({.row = "A5",
                  .figure = "values that differ between cuts of a frame into tiles and passes",
                  .expected = 0,
                  .measured = differing,
                  .naive = std::fabs(forwards - naive::Sum(values)),
                  .naive_by = "running sums of a frame forwards and backwards: their difference"});
}

TEST(TransportStability, A5StoppedPassesReportIt) {
  const CompiledScenePtr scene = Compile(SphereInterior(0.7f).scene, SquareSettings(16, 32, 10));
  std::stop_source stop;
  stop.request_stop();
  const auto tile = RenderTilePass(*scene, {0, 0, 16, 16}, {0, 32}, stop.get_token(), nullptr);
  EXPECT_EQ(tile.status().code(), absl::StatusCode::kCancelled);
}

// C2: every filter keeps a constant image constant, also those with negative lobes.
TEST(TransportStability, C2EveryFilterKeepsAConstant) {
  for (const auto kind : {FilterDescription::Kind::kBox, FilterDescription::Kind::kTriangle,
                          FilterDescription::Kind::kGaussian, FilterDescription::Kind::kMitchell}) {
    TestScene t({0, 0, 0}, {0, 0, 1}, 60);
    t.ConstantEnvironment({0.25f, 0.5f, 3});
    t.scene.filter.kind = kind;
    t.scene.filter.radius_x_px = t.scene.filter.radius_y_px = 2;
    const TileMean mean = RenderMean(t.scene, SquareSettings(4, 64, 5));
    EXPECT_NEAR(mean.mean.r, 0.25f, 1e-6f * 0.25f);
    EXPECT_NEAR(mean.mean.g, 0.5f, 1e-6f * 0.5f);
    EXPECT_NEAR(mean.mean.b, 3, 3e-6f);
  }
}

// The room with a box around its ball, so that most paths and shadow rays cross the box.
template <typename Material>
FilmTile RoomWithBox(Material material, RenderPlan* plan) {
  TestScene t = LitRoom(1);
  t.AddShape(MeshShape{t.Box({-0.1f, -0.9f, 0}, {0.7f, -0.1f, 0.8f})}, t.AddMaterial(material));
  const CompiledScenePtr scene = Compile(t.scene, SquareSettings(16, 32, 5));
  *plan = PlanOf(*scene);
  return RenderAll(*scene);
}

// M5: glass of index 1 is invisible: it equals a declared interface to the bit, which takes no
// scattering event and blocks no shadow ray; and it equals the room without it up to the rounding
// of ray origins at the crossings.
TEST(TransportStability, M5GlassOfIndexOneIsInvisible) {
  const FilmTile empty = RenderAll(*Compile(LitRoom(1).scene, SquareSettings(16, 32, 5)));
  RenderPlan plan;
  const FilmTile passed = RoomWithBox(InterfaceMaterial{}, &plan);
  DielectricMaterial smooth, rough;
  smooth.eta.mean = rough.eta.mean = 1;
  rough.roughness.u.value = rough.roughness.v.value = 0.3f;
  ThinDielectricMaterial thin;
  thin.eta.mean = 1;
  const FilmTile boxes[] = {RoomWithBox(smooth, &plan), RoomWithBox(rough, &plan),
                            RoomWithBox(thin, &plan)};
  EXPECT_TRUE(plan.traits & static_cast<TraitBits>(Trait::kAlpha));
  EXPECT_FALSE(plan.traits & static_cast<TraitBits>(Trait::kSpecularTransmission));
  for (const FilmTile& box : boxes) EXPECT_TRUE(box == passed);
  for (const FilmChannel c : {FilmChannel::kRedHi, FilmChannel::kGreenHi, FilmChannel::kBlueHi,
                              FilmChannel::kAlpha, FilmChannel::kDepth}) {
    for (size_t i = 0; i < empty.plane_size(); ++i) {
      const float without = empty.channel(c)[i];
      EXPECT_NEAR(passed.channel(c)[i], without, 1e-5f * without)
          << static_cast<int>(c) << " " << i;
    }
  }
}

}  // namespace
}  // namespace sheaf::render
