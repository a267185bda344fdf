// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A metal with a bump map must be as bright under a constant sky as the grooves that the map
// represents, modeled as triangles. Mirror reflection about a perturbed normal sends much of the
// light below the surface. pbrt-v4 discards that light, so that gold with strong maps is darker
// than its grooves.
#include <cmath>
#include <filesystem>
#include <numbers>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/light_tables.h"
#include "tests/support/temporary_path.h"
#include "tests/support/test_scene.h"

namespace sheaf::render {
namespace {

constexpr Rgb kGold{1, 0.78f, 0.34f};
constexpr double kPeriod = 0.5, kSteepest = 1;
// Grooves h = a sin(2 pi x / period) with a maximum slope of 45 degrees.
constexpr double kHeight = kSteepest * kPeriod / (2 * std::numbers::pi);

int32_t AddGold(TestScene* t) {
  ConductorMaterial metal;
  metal.has_reflectance = true;
  metal.reflectance.value.rgb = kGold;
  return t->AddMaterial(metal);
}
// A view from the side of the center of a field so wide that its borders are not visible.
TestScene ViewAt(double degrees) {
  const double angle = degrees * std::numbers::pi / 180;
  TestScene t({40 * std::sin(angle), 0.01, 40 * std::cos(angle)}, {0, 0, 0}, 4, {0, 1, 0});
  t.ConstantEnvironment(Rgb::Gray(1));
  return t;
}
constexpr float kHalfWidth = 32;  // A whole number of periods.

TileMean RenderGrooves(double degrees) {
  TestScene t = ViewAt(degrees);
  constexpr int kStepsPerPeriod = 128, kSteps = static_cast<int>(2 * kHalfWidth / kPeriod);
  std::vector<Vec3f> positions;
  std::vector<uint32_t> indices;
  for (int i = 0; i <= kSteps * kStepsPerPeriod; ++i) {
    const double periods = static_cast<double>(i) / kStepsPerPeriod;
    const auto x = static_cast<float>(periods * kPeriod - static_cast<double>(kHalfWidth)),
               z = static_cast<float>(kHeight * std::sin(2 * std::numbers::pi * periods));
    positions.push_back({x, -kHalfWidth, z});
    positions.push_back({x, kHalfWidth, z});
    if (i == 0) continue;
    const auto k = static_cast<uint32_t>(2 * i);
    indices.insert(indices.end(), {k - 2, k, k + 1, k - 2, k + 1, k - 1});
  }
  t.AddShape(MeshShape{t.AddMesh(std::move(positions), std::move(indices))}, AddGold(&t));
  return RenderMean(t.scene, SquareSettings(32, 64, 100));
}

TileMean RenderMapped(double degrees) {
  const std::filesystem::path map = sheaf::testing::TemporaryPath("grooves.pfm");
  constexpr int kTexels = 256;
  std::vector<Rgb> texels(static_cast<size_t>(kTexels) * kTexels);
  for (size_t i = 0; i < texels.size(); ++i) {
    const double periods = (static_cast<double>(i % kTexels) + 0.5) / kTexels;
    texels[i] = Rgb::Gray(static_cast<float>(kHeight * std::sin(2 * std::numbers::pi * periods)));
  }
  testing::WritePfm(map.string(), kTexels, texels);
  TestScene t = ViewAt(degrees);
  TextureDescription texture;
  texture.name = "grooves";
  ImageTexture image;
  image.file = "grooves.pfm";
  texture.texture = image;
  t.scene.textures.push_back(texture);
  const float w = kHalfWidth, uv = 2 * kHalfWidth / static_cast<float>(kPeriod);
  const int32_t plane = t.Quad({-w, -w, 0}, {w, -w, 0}, {w, w, 0}, {-w, w, 0});
  t.scene.meshes.back().uvs = {{0, 0}, {uv, 0}, {uv, uv}, {0, uv}};
  t.AddShape(MeshShape{plane}, AddGold(&t));
  t.scene.materials.back().displacement.texture = 0;
  TableFileSource files({{"grooves.pfm", map.string()}});
  CompileLimits limits;
  limits.build_threads = 1;
  const auto compiled = CompileScene(t.scene, SquareSettings(32, 64, 100), files, limits);
  EXPECT_TRUE(compiled.ok()) << compiled.status();
  TileMean mean = MeanOf(RenderAll(**compiled));
  std::filesystem::remove(map);
  return mean;
}

// Fraction of positions on the map whose mirror reflection is above the surface.
double FractionAbove(double degrees) {
  constexpr int kPlaces = 100000;
  int above = 0;
  for (int i = 0; i < kPlaces; ++i) {
    const double slope = kSteepest * std::cos(2 * std::numbers::pi * (i + 0.5) / kPlaces);
    const double turned = std::atan(-slope), view = degrees * std::numbers::pi / 180;
    above += std::fabs(2 * turned - view) < std::numbers::pi / 2 ? 1 : 0;
  }
  return static_cast<double>(above) / kPlaces;
}

// Red, which this gold reflects completely, is equally bright on the map and in the grooves. Green
// is slightly darker in the grooves, which may absorb it twice. Blue is mostly absorbed at each
// reflection; its brightness in the grooves lies between that of the map and that of the map
// without the reflections below the surface.
TEST(BumpedMetalTest, NormalMapsMatchRealGrooves) {
  for (const double degrees : {30.0, 45.0, 60.0}) {
    SCOPED_TRACE(degrees);
    const TileMean grooves = RenderGrooves(degrees), mapped = RenderMapped(degrees);
    const double above = FractionAbove(degrees);
    EXPECT_LT(above, 0.7);
    EXPECT_NEAR(grooves.mean.r, 1, 1e-3);
    EXPECT_NEAR(mapped.mean.r, 1, 1e-3);
    EXPECT_NEAR(mapped.mean.g, grooves.mean.g, 0.045);
    EXPECT_LT(above * static_cast<double>(mapped.mean.g),
              0.75 * static_cast<double>(grooves.mean.g));
    EXPECT_GT(mapped.mean.b, grooves.mean.b);
    EXPECT_LT(above * static_cast<double>(mapped.mean.b), static_cast<double>(grooves.mean.b));
  }
}

}  // namespace
}  // namespace sheaf::render
