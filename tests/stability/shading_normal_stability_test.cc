// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Normals perturbed by maps: row M10 of the catalogue of hard cases, and properties that hold for
// every tilt: the hemispheres, energy conservation, and continuity at the horizon. Bump maps
// against the planes that they represent.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include "common/math/elementary.h"
#include "tests/render/perturbed_surface.h"
#include "tests/support/bsdf_fixtures.h"
#include "tests/support/chi_square.h"
#include "tests/support/hard_case.h"
#include "tests/support/naive_materials.h"
#include "tests/support/temporary_path.h"
#include "worker/render/material/material.h"

namespace sheaf::render {
namespace {

using sheaf::testing::BsdfFixture;
using sheaf::testing::CounterUniforms;

using testing::FromAngles;
using testing::kNormalSources;
using testing::kUp;
using testing::PerturbedSurface;

constexpr double kPerturbationDegrees[] = {0.01, 5, 30, 60, 85};
const Vec3f kViews[] = {FromAngles(0, 0),    FromAngles(50, 20),   FromAngles(50, 160),
                        FromAngles(88, 0),   FromAngles(88, 180),  FromAngles(89.9, 90),
                        FromAngles(130, 30), FromAngles(100, 180), FromAngles(91, 0)};

// Integral of the scattered light over both hemispheres, on an even grid of solid angle.
double PerturbedAlbedo(const Bsdf& bsdf, const PerturbedSurface& t) {
  constexpr int kCos = 200, kPhi = 200;
  double sum = 0;
  for (int i = 0; i < kCos; ++i) {
    const double z = (2 * i + 1.0) / kCos - 1, r = std::sqrt(1 - z * z);
    for (int j = 0; j < kPhi; ++j) {
      const double phi = 2 * std::numbers::pi * (j + 0.5) / kPhi;
      const Vec3f wi = ToFloat(Vec3d{r * std::cos(phi), r * std::sin(phi), z});
      const BsdfValue value = t.normal.Eval<kAllTraits>(bsdf, t.wo, t.frame.ToLocal(wi));
      sum += static_cast<double>(value.f_cos.g);
    }
  }
  return sum * 4 * std::numbers::pi / (kCos * kPhi);
}

TEST(ShadingNormalTest, WhiteStaysWhiteAtEveryPerturbation) {
  const BsdfFixture white = sheaf::testing::MakeDiffuseFixture(Rgb::Gray(1));
  const BsdfFixture sheet = sheaf::testing::MakeSheetFixture(Rgb::Gray(0.25f), Rgb::Gray(0.75f));
  for (const double tilt : kPerturbationDegrees) {
    for (const Vec3f wo : kViews) {
      for (const PerturbedNormal::Source source : kNormalSources) {
        for (const Vec2f u : {Vec2f{0.1f, 0.2f}, Vec2f{0.9f, 0.8f}}) {
          const PerturbedSurface t(tilt, wo, u, source);
          EXPECT_NEAR(PerturbedAlbedo(white.bsdf, t), 1, 5e-3)
              << tilt << " seen along " << wo.x << ' ' << wo.z;
          EXPECT_NEAR(PerturbedAlbedo(sheet.bsdf, t), 1, 5e-3)
              << tilt << " seen along " << wo.x << ' ' << wo.z;
        }
      }
    }
  }
}

// A rough metal may lose energy as its own lobe does, but never gains.
TEST(ShadingNormalTest, PerturbationAddsNoEnergyToAMetal) {
  const BsdfFixture metal = sheaf::testing::MakeMirrorFixture(0.4f, 0.4f, true);
  for (const double tilt : kPerturbationDegrees) {
    for (const Vec3f wo : kViews) {
      for (const PerturbedNormal::Source source : kNormalSources) {
        const PerturbedSurface t(tilt, wo, {0.4f, 0.7f}, source);
        const double albedo = PerturbedAlbedo(metal.bsdf, t);
        EXPECT_GT(albedo, 0.97) << tilt << ' ' << wo.x << ' ' << wo.z;
        EXPECT_LT(albedo, 1.01) << tilt << ' ' << wo.x << ' ' << wo.z;
      }
    }
  }
}

TEST(ShadingNormalTest, NothingIsScatteredThroughAnOpaqueSurface) {
  const BsdfFixture white = sheaf::testing::MakeDiffuseFixture(Rgb::Gray(1));
  for (uint64_t i = 0; i < 20000; ++i) {
    const std::array<float, 3> a = CounterUniforms(11, i), b = CounterUniforms(12, i);
    const Vec3f wo =
        FromAngles(180.0 * static_cast<double>(a[0]), 360.0 * static_cast<double>(a[1]));
    const PerturbedSurface t(89 * static_cast<double>(a[2]), wo, {b[0], b[1]},
                             kNormalSources[i % 2]);
    const auto sample = t.normal.Sample<kAllTraits>(white.bsdf, t.wo, b[2], {a[1], b[0]});
    if (!sample) continue;
    EXPECT_GT(t.frame.ToWorld(sample->wi).z * wo.z, -1e-6f);
    EXPECT_TRUE(std::isfinite(sample->pdf) && IsFinite(sample->weight));
    EXPECT_LE(sample->weight.g, 1.001f);
  }
}

// Mirrors stay mirrors: all of the light leaves on the right side, whatever the map contains.
TEST(ShadingNormalTest, MirrorsHaveNoBlackSpots) {
  const BsdfFixture mirror = sheaf::testing::MakeMirrorFixture(0, 0, false);
  for (uint64_t i = 0; i < 20000; ++i) {
    const std::array<float, 3> a = CounterUniforms(21, i), b = CounterUniforms(22, i);
    const Vec3f wo =
        FromAngles(89.99 * static_cast<double>(a[0]), 360.0 * static_cast<double>(a[1]));
    const PerturbedSurface t(89 * static_cast<double>(a[2]), wo, {b[0], b[1]},
                             kNormalSources[i % 2]);
    const auto sample = t.normal.active()
                            ? t.normal.Sample<kAllTraits>(mirror.bsdf, t.wo, b[2], {a[1], b[0]})
                            : SampleBsdf<kAllTraits>(mirror.bsdf, t.wo, b[2], {a[1], b[0]});
    ASSERT_TRUE(sample.has_value()) << i;
    EXPECT_NEAR(sample->weight.g, 1, 1e-4);
    EXPECT_GT(t.frame.ToWorld(sample->wi).z, 0);
  }
}

// Smooth glass reflects or transmits all light, from either side; weights include the square of the
// index by which radiance changes across the surface.
TEST(ShadingNormalTest, GlassHasNoBlackSpots) {
  const BsdfFixture glass = sheaf::testing::MakeDielectricFixture(0, 0, 1.5f, false);
  for (uint64_t i = 0; i < 20000; ++i) {
    const std::array<float, 3> a = CounterUniforms(41, i), b = CounterUniforms(42, i);
    const Vec3f wo = FromAngles(180 * static_cast<double>(a[0]), 360.0 * static_cast<double>(a[1]));
    const PerturbedSurface t(89 * static_cast<double>(a[2]), wo, {b[0], b[1]},
                             kNormalSources[i % 2]);
    if (!t.normal.active() || std::fabs(wo.z) < 1e-4f) continue;
    const auto sample = t.normal.Sample<kAllTraits>(glass.bsdf, t.wo, b[2], {a[1], b[0]});
    ASSERT_TRUE(sample.has_value()) << i;
    const bool transmits = (sample->flags & kBsdfTransmission) != 0;
    const float weight = transmits ? sample->weight.g * sample->eta_scale : sample->weight.g;
    EXPECT_NEAR(weight, 1, 1e-4);
    EXPECT_EQ(transmits, t.frame.ToWorld(sample->wi).z * wo.z < 0) << i;
  }
}

TEST(ShadingNormalTest, ScatteringVanishesTowardTheHorizon) {
  const BsdfFixture white = sheaf::testing::MakeDiffuseFixture(Rgb::Gray(1));
  for (const double tilt : {5.0, 30.0, 60.0}) {
    for (double phi = 0; phi < 360; phi += 7) {
      // Averages over the random numbers of the perturbed normal, as an image does.
      double level = 0, higher = 0;
      constexpr int kDraws = 512;
      for (int i = 0; i < kDraws; ++i) {
        const Vec2f u{(static_cast<float>(i) + 0.5f) / kDraws, static_cast<float>(i % 2) * 0.5f};
        const PerturbedSurface t(tilt, FromAngles(20, 40), u);
        const auto at = [&](double height_degrees) {
          const Vec3f wi = t.frame.ToLocal(FromAngles(90 - height_degrees, phi));
          return static_cast<double>(t.normal.Eval<kAllTraits>(white.bsdf, t.wo, wi).f_cos.g);
        };
        level += at(0.001) / kDraws;
        higher += at(0.01) / kDraws;
      }
      EXPECT_LT(level, 0.02) << tilt << ' ' << phi;
      EXPECT_LT(std::fabs(higher - level), 0.02) << tilt << ' ' << phi;
    }
  }
}

TEST(ShadingNormalTest, BentNormalsFaceTheViewerAndReflectUpwards) {
  for (uint64_t i = 0; i < 100000; ++i) {
    const std::array<float, 3> a = CounterUniforms(31, i), b = CounterUniforms(32, i);
    const auto angle = [](float u) { return static_cast<double>(u); };
    const Vec3f ng = FromAngles(180 * angle(a[0]), 360 * angle(a[1]));
    const Vec3f any = FromAngles(180 * angle(a[2]), 360 * angle(b[0]));
    const Vec3f wo = FromAngles(180 * angle(b[1]), 360 * angle(b[2]));
    const Vec3f lifted = LiftNormal(any, ng);
    EXPECT_GE(Dot(lifted, ng), kPerturbedCosineMin * 0.999f);
    const Vec3f n = BendNormal(lifted, ng, wo);
    EXPECT_NEAR(Length(n), 1, 1e-5);
    EXPECT_GT(Dot(n, ng), 0);
    const float side = Dot(wo, ng) < 0 ? -1.0f : 1.0f;
    const Vec3f r = 2 * Dot(wo, n) * n - wo;
    if (std::fabs(Dot(wo, ng)) < 1e-5f) continue;
    EXPECT_GT(side * Dot(wo, n), 0) << i;
    EXPECT_GT(side * Dot(r, ng), 0) << i;
  }
}

// --- Maps ----------------------------------------------------------------------------------------

// Little-endian, from the bottom row up.
void WritePfm(const std::string& path, int width, int height, const std::vector<Rgb>& texels) {
  std::ofstream file(path, std::ios::binary);
  file << "PF\n" << width << ' ' << height << "\n-1.0\n";
  for (int y = height - 1; y >= 0; --y) {
    for (int x = 0; x < width; ++x) {
      const Rgb c =
          texels[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)];
      file.write(reinterpret_cast<const char*>(&c), 12);
    }
  }
}

class NormalMapTest : public ::testing::Test {
 protected:
  void SetUp() override {
    directory_ = sheaf::testing::TemporaryPath("maps");
    std::filesystem::create_directories(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  std::unique_ptr<MaterialTable> Build(SceneDescription scene, int width, int height,
                                       const std::vector<Rgb>& texels) {
    const std::string path = (directory_ / "map.pfm").string();
    WritePfm(path, width, height, texels);
    TableFileSource files({{"map.pfm", path}});
    auto table = MaterialTable::Build(scene, files, {1 << 20, false, false});
    EXPECT_TRUE(table.ok()) << table.status();
    return table.ok() ? *std::move(table) : nullptr;
  }
  // A diffuse material with the image as its normal map.
  std::unique_ptr<MaterialTable> WithNormals(Rgb texel) {
    SceneDescription scene;
    TextureDescription texture;
    texture.is_color = true;
    ImageTexture image;
    image.file = "map.pfm";
    texture.texture = image;
    scene.textures.push_back(texture);
    scene.materials.push_back({"", DiffuseMaterial{}, {}, 0});
    return Build(std::move(scene), 1, 1, {texel});
  }
  // A diffuse material whose height rises by slope_u along u and by slope_v along v, about (1/2,
  // 1/2).
  std::unique_ptr<MaterialTable> WithHeights(double slope_u, double slope_v, float scale = 1,
                                             const UvMapping& mapping = {}) {
    SceneDescription scene;
    TextureDescription texture;
    ImageTexture image;
    image.file = "map.pfm";
    image.scale = scale;
    image.mapping = mapping;
    texture.texture = image;
    scene.textures.push_back(texture);
    scene.materials.push_back({"", DiffuseMaterial{}, {}, kNone, 1, {}, {0, 0}});
    // Texel centers are 1/2 apart; row 0 is at v = 3/4.
    const auto at = [&](double u, double v) {
      return Rgb::Gray(static_cast<float>(8 + slope_u * u + slope_v * v));
    };
    return Build(std::move(scene), 2, 2,
                 {at(0.25, 0.75), at(0.75, 0.75), at(0.25, 0.25), at(0.75, 0.25)});
  }

  std::filesystem::path directory_;
};

const TexturePoint kMiddle{{0.5f, 0.5f}, {}};

void ExpectDirection(Vec3f n, Vec3d expected) {
  const Vec3d unit = Normalize(expected);
  for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(n[c], unit[c], 2e-6) << "component " << c;
}

TEST_F(NormalMapTest, TexelsAreTangentSpaceDirections) {
  const TangentPlane plane{{0, 0, 1}, {0, 3, 0}, {-2, 0, 0}, true};
  ExpectDirection(WithNormals({0.5f, 0.5f, 1})->ShadingNormal(0, kMiddle, 0, plane), {0, 0, 1});
  // Red along dpdu, green along dpdv.
  ExpectDirection(WithNormals({0.8f, 0.4f, 0.9f})->ShadingNormal(0, kMiddle, 0, plane),
                  {0.2, 0.6, 0.8});
  const TangentPlane mirrored{{0, 0, 1}, {0, 3, 0}, {2, 0, 0}, true};
  ExpectDirection(WithNormals({0.8f, 0.4f, 0.9f})->ShadingNormal(0, kMiddle, 0, mirrored),
                  {-0.2, 0.6, 0.8});
}

// A texel that is no direction or contains NaN keeps the surface's normal.
TEST_F(NormalMapTest, M10InvalidTexelsKeepTheNormal) {
  const TangentPlane plane{{0.6, 0, 0.8}, {0, 3, 0}, {-2, 0, 0}, true};
  const auto table = WithNormals(Rgb::Gray(0.5f));
  EXPECT_EQ(table->ShadingNormal(0, kMiddle, 0, plane), ToFloat(plane.n));
  TangentPlane without;
  without.n = plane.n;
  const auto steep = WithNormals({0.9f, 0.1f, 0.6f});
  EXPECT_EQ(steep->ShadingNormal(0, kMiddle, 0, without), ToFloat(plane.n));
  const auto infinite = WithNormals({std::numeric_limits<float>::infinity(), 0.5f, 1});
  const Vec3f n = infinite->ShadingNormal(0, kMiddle, 0, plane);
  ExpectHardCase(
      {.row = "M10",
       .figure = "length of the normal of a texel with an infinity",
       .expected = 1,
       .measured = Length(n),
       .tolerance = 1e-6,
       .naive = naive::TexelNormalLength({std::numeric_limits<float>::infinity(), 0.5f, 1}),
       .naive_by = "2 t - 1 over its length"});
}

// The height a x + b y over the plane has the normal (-a, -b, 1) for every parametrization of the
// plane: stretched, sheared, flipped.
TEST_F(NormalMapTest, BumpMapsMatchTheirPlane) {
  constexpr double kA = 0.5, kB = -0.25;
  const std::array<Vec3d, 2> kTangents[] = {{Vec3d{1, 0, 0}, Vec3d{0, 1, 0}},
                                            {Vec3d{4, 0, 0}, Vec3d{0, 0.5, 0}},
                                            {Vec3d{1, 1, 0}, Vec3d{-0.5, 2, 0}},
                                            {Vec3d{-1, 0, 0}, Vec3d{0, 1, 0}},
                                            {Vec3d{0, 2, 0}, Vec3d{1, 0.5, 0}}};
  for (const auto& [dpdu, dpdv] : kTangents) {
    const auto table = WithHeights(kA * dpdu.x + kB * dpdu.y, kA * dpdv.x + kB * dpdv.y);
    ExpectDirection(table->ShadingNormal(0, kMiddle, 0, {{0, 0, 1}, dpdu, dpdv, true}),
                    {-kA, -kB, 1});
    // Seen from the other side, heights have the opposite sign.
    ExpectDirection(table->ShadingNormal(0, kMiddle, 0, {{0, 0, -1}, dpdu, dpdv, true}),
                    {-kA, -kB, -1});
  }
}

TEST_F(NormalMapTest, ScalingKeepsNormalBits) {
  const TangentPlane plane{{0.6, 0, 0.8}, {0, 3, 0}, {-1.6, 0.3, 1.2}, true};
  const Vec3f n = WithHeights(0.3f, 0.7f)->ShadingNormal(0, kMiddle, 0, plane);
  EXPECT_NE(n, ToFloat(plane.n));
  for (const int exponent : {-20, -7, 20}) {
    const double scale = std::ldexp(1.0, exponent);
    const TangentPlane scaled{plane.n, plane.dpdu * scale, plane.dpdv * scale, true};
    const auto table = WithHeights(0.3f, 0.7f, static_cast<float>(scale));
    EXPECT_EQ(table->ShadingNormal(0, kMiddle, 0, scaled), n) << exponent;
  }
}

// The height of a triangle wave of period 1 that rises by `slope` about 1/2, as the image of two
// texels gives it.
float Wave(float slope, float x) {
  const float from_half = x - std::floor(x) - 0.5f;
  return std::fabs(from_half) < 0.25f ? slope * from_half
                                      : slope * ((from_half > 0 ? 0.5f : -0.5f) - from_half);
}
// The slope between two floats of uv that are .0005 apart on either side of 1/2.
float SlopeOverUv(float slope, float tiles) {
  const float step = 0.0005f;
  return (Wave(slope, tiles * (0.5f + step)) - Wave(slope, tiles * (0.5f - step))) /
         (2 * step * tiles);
}

// Slopes are those of the texture, however much of it lies between u = 0 and u = 1.
TEST_F(NormalMapTest, M16SlopesFollowTheScaleOfTheTexture) {
  constexpr double kA = 0.5, kB = -0.25;
  const auto figure = [](const char* by, double tiles, Vec3f n) {
    const auto odd = static_cast<float>(tiles);
    ExpectHardCase({.row = "M16",
                    .figure = std::string("slope of ") + InWords(tiles) + " tiles " + by,
                    .expected = kA,
                    .measured = -n.x / n.z,
                    .tolerance = 2e-4,
                    .naive = SlopeOverUv(static_cast<float>(kA), odd),
                    .naive_by = "a difference over .0005 of uv"});
    EXPECT_NEAR(-n.y / n.z, kB, 2e-4) << by << " " << tiles;
  };
  for (const double tiles : {1.0, 1001.0, 1000001.0}) {
    SCOPED_TRACE(tiles);
    // One tile of the map is one unit of space. Odd numbers have the middle of a tile at 1/2.
    const Vec3d dpdu{tiles, 0, 0}, dpdv{0, tiles, 0};
    const auto tiled = static_cast<float>(tiles);
    UvMapping by_uv;
    by_uv.scale_u = by_uv.scale_v = tiled;
    figure(
        "by uv", tiles,
        WithHeights(kA, kB, 1, by_uv)->ShadingNormal(0, kMiddle, 0, {{0, 0, 1}, dpdu, dpdv, true}));
    UvMapping turned;  // u of the texture is v of the mesh.
    turned.scale_u = turned.scale_v = 0;
    turned.turn_u = turned.turn_v = tiled;
    figure("by turned uv", tiles,
           WithHeights(kA, kB, 1, turned)
               ->ShadingNormal(0, kMiddle, 0, {{0, 0, 1}, dpdv, dpdu, true}));
    UvMapping planar;
    planar.kind = UvMapping::Kind::kPlanar;
    figure("of a plane", tiles,
           WithHeights(kA, kB, 1, planar)
               ->ShadingNormal(0, {{}, {0.5, 0.5, 7}, {}}, 0, {{0, 0, 1}, dpdu, dpdv, true}));
  }
  // Around an axis: u of the texture is an angle.
  for (const double size : {1.0, 1e3, 1e6}) {
    UvMapping around;
    around.kind = UvMapping::Kind::kCylindrical;
    const double radius = 1 / (2 * kPi);
    const Vec3f n = WithHeights(kA, kB, 1, around)
                        ->ShadingNormal(0, {{}, {radius, 0, 0.5}, {}}, 0,
                                        {{1, 0, 0}, {0, size, 0}, {0, 0, size}, true});
    // The step along the tangent leaves the surface, as the two texels are large.
    EXPECT_NEAR(-n.y / n.x, kA, 0.01) << size;
    EXPECT_NEAR(-n.z / n.x, kB, 0.01) << size;
  }
}

TEST_F(NormalMapTest, FlatBumpMapsKeepTheNormal) {
  const TangentPlane plane{{0, 0, 1}, {0, 3, 0}, {-2, 0, 0}, true};
  EXPECT_EQ(WithHeights(0, 0)->ShadingNormal(0, kMiddle, 0, plane), Vec3f(0, 0, 1));
}

}  // namespace
}  // namespace sheaf::render
