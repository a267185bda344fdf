// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Principled materials whose layers have textures scatter as those of the constants that their
// textures have at the point.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/math/elementary.h"
#include "tests/support/temporary_path.h"
#include "worker/render/bsdf/bsdf_inl.h"
#include "worker/render/bsdf/principled_table.h"
#include "worker/render/material/material.h"
#include "worker/render/material/principled.h"

namespace sheaf::render {
namespace {

constexpr uint64_t kTextureCacheBytes = uint64_t{16} << 20;
// Where the textures of UOver are looked up: exact for levels of 255 steps.
constexpr float kPlaceU = 0.4f;
const TexturePoint kTexturedPoint{{kPlaceU, 0.5f}, {}};

PrincipledMaterial Layered() {
  PrincipledMaterial material;
  material.base_color.value.rgb = {0.2f, 0.3f, 0.4f};
  material.specular_tint.value.rgb = Rgb::Gray(1);
  material.roughness.value = 0.5f;
  return material;
}

// A float texture from 0 at u = 0 to `most` at u = 1.
TextureDescription UOver(float most) {
  TextureDescription texture;
  BilerpTexture bilerp;
  bilerp.value[0] = bilerp.value[2] = 0;
  bilerp.value[1] = bilerp.value[3] = most;
  texture.texture = bilerp;
  return texture;
}

std::unique_ptr<MaterialTable> BuildOne(const MaterialDescription& material,
                                        std::vector<TextureDescription> textures,
                                        const std::map<std::string, std::string>& paths = {}) {
  SceneDescription scene;
  scene.materials.push_back(material);
  scene.textures = std::move(textures);
  TableFileSource files(paths);
  auto table = MaterialTable::Build(scene, files, {kTextureCacheBytes});
  EXPECT_TRUE(table.ok()) << table.status();
  return table.ok() ? *std::move(table) : nullptr;
}
MaterialDescription DescribedAs(const PrincipledMaterial& material) {
  MaterialDescription description;
  description.material = material;
  return description;
}

void ExpectSameScattering(const PrincipledMaterial& textured,
                          std::vector<TextureDescription> textures,
                          const PrincipledMaterial& constant, double tolerance) {
  const auto table = BuildOne(DescribedAs(textured), std::move(textures));
  const auto other = BuildOne(DescribedAs(constant), {});
  ASSERT_NE(table, nullptr);
  ASSERT_NE(other, nullptr);
  const Bsdf bsdf = table->Evaluate<kAllTraits>(0, kTexturedPoint, 0);
  const Bsdf expected = other->Evaluate<kAllTraits>(0, kTexturedPoint, 0);
  for (const Vec3f wi : {Vec3f{-0.48f, 0, 0.8772f}, Vec3f{0.3f, 0.4f, 0.866f}}) {
    const Vec3f wo = Normalize(Vec3f{0.5f, 0.1f, 0.86f}), in = Normalize(wi);
    const BsdfValue value = EvalBsdf<kAllTraits>(bsdf, wo, in);
    const BsdfValue same = EvalBsdf<kAllTraits>(expected, wo, in);
    for (size_t c = 0; c < 3; ++c) {
      EXPECT_NEAR(value.f_cos[c] / same.f_cos[c], 1, tolerance) << "component " << c;
    }
    EXPECT_NEAR(value.pdf / same.pdf, 1, tolerance);
  }
}

TEST(PrincipledTexturesTest, CoatRoughness) {
  PrincipledMaterial constant = Layered();
  constant.coat.value = 1;
  constant.coat_roughness.value = kPlaceU;
  PrincipledMaterial textured = constant;
  textured.coat_roughness.texture = 0;
  ExpectSameScattering(textured, {UOver(1)}, constant, 1e-3);
}

TEST(PrincipledTexturesTest, SheenRoughness) {
  PrincipledMaterial constant = Layered();
  constant.sheen_color.value.rgb = {0.5f, 0.25f, 0.75f};
  constant.sheen_roughness.value = 12.0f / (PrincipledLevels::kSheenLevelsMax - 1);
  PrincipledMaterial textured = constant;
  textured.sheen_roughness.texture = 0;
  ExpectSameScattering(textured, {UOver(1)}, constant, 1e-6);
}

// The film is that of its own thickness; the energy of what is below follows a table near to it.
TEST(PrincipledTexturesTest, FilmThickness) {
  PrincipledMaterial constant = Layered();
  constant.iridescence.value = 1;
  constant.iridescence_thickness_nm.value = 500 * kPlaceU;
  PrincipledMaterial textured = constant;
  textured.iridescence_thickness_nm.texture = 0;
  textured.film_most_nm = 500;
  ExpectSameScattering(textured, {UOver(500)}, constant, 0.02);
  const auto table = BuildOne(DescribedAs(textured), {UOver(500)});
  EXPECT_NEAR(table->Evaluate<kAllTraits>(0, kTexturedPoint, 0).principled->film.thickness_nm, 200,
              1e-3);
  // Where the film has no thickness, it is not there.
  const TexturePoint edge{{0, 0.5f}, {}};
  EXPECT_FALSE(table->Evaluate<kAllTraits>(0, edge, 0).principled->has_film);
}

TEST(PrincipledTexturesTest, StrengthAndRotationOfAnisotropy) {
  PrincipledMaterial constant = Layered();
  constant.metallic.value = 1;
  constant.anisotropy.value = kPlaceU;
  const auto turn = static_cast<float>(kPi) / 4;
  constant.rotation_radians.value = turn;
  PrincipledMaterial textured = constant;
  textured.anisotropy.texture = 0;
  textured.rotation_radians.texture = 1;
  // Tables of all widths stand for those of this one.
  ExpectSameScattering(textured, {UOver(1), UOver(turn / kPlaceU)}, constant, 0.02);
}

// Two inputs that vary have fewer levels each; they stay within the limit.
TEST(PrincipledTexturesTest, LevelsAreBounded) {
  const auto levels = PrincipledLevels::For({true, true, true, true});
  int surfaces = 1;
  for (const int count : levels.count) surfaces *= count;
  EXPECT_LE(surfaces, PrincipledLevels::kSurfacesMax);
  EXPECT_EQ(PrincipledLevels::For({false, false, true, false}).count[2], 256);
  EXPECT_EQ(PrincipledLevels::For({}).count[0], 1);
  using Levels = PrincipledLevels;
  const auto one = Levels::For({true, false, false, true});
  EXPECT_EQ(one.LevelAt(Levels::kCoatRoughness, 2), one.count[Levels::kCoatRoughness] - 1);
  EXPECT_EQ(one.LevelAt(Levels::kCoatRoughness, NAN), 0);
  EXPECT_EQ(one.LevelAt(Levels::kTurn, 0.9999f), 0);
}

class PrincipledImagesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    directory_ = testing::TemporaryPath("principled");
    std::filesystem::create_directories(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  // A texture of one texel.
  std::pair<std::vector<TextureDescription>, std::map<std::string, std::string>> Texel(Rgb texel) {
    const std::string path = (directory_ / "texel.pfm").string();
    std::ofstream file(path, std::ios::binary);
    file << "PF\n1 1\n-1.0\n";
    file.write(reinterpret_cast<const char*>(&texel.r), sizeof texel.r);
    file.write(reinterpret_cast<const char*>(&texel.g), sizeof texel.g);
    file.write(reinterpret_cast<const char*>(&texel.b), sizeof texel.b);
    TextureDescription texture;
    texture.is_color = true;
    texture.role = ColorRole::kUnbounded;
    ImageTexture image;
    image.file = "texel.pfm";
    image.encoding = ColorEncoding::kLinear;
    texture.texture = image;
    return {{texture}, {{"texel.pfm", path}}};
  }

  std::filesystem::path directory_;
};

// Red and green are the direction, to which the rotation is added.
TEST_F(PrincipledImagesTest, DirectionOfAnisotropy) {
  PrincipledMaterial material = Layered();
  material.anisotropy.value = 0.8f;
  const auto rotation = static_cast<float>(kPi) / 8;
  material.rotation_radians.value = rotation;
  material.anisotropy_direction = 0;
  const auto [textures, paths] = Texel({0.5f, 1, 0});  // Along +v.
  const auto table = BuildOne(DescribedAs(material), textures, paths);
  ASSERT_NE(table, nullptr);
  const Bsdf bsdf = table->Evaluate<kAllTraits>(0, kTexturedPoint, 0);
  EXPECT_TRUE(bsdf.principled->turned);
  // A quarter turn and the rotation, or half a turn less: the axes are the same.
  EXPECT_NEAR(std::fabs(bsdf.principled->turn.cos), std::sin(static_cast<double>(rotation)), 1e-5);
  EXPECT_NEAR(bsdf.principled->turn.sin, std::cos(static_cast<double>(rotation)), 1e-5);
  EXPECT_LT(bsdf.principled->turn.cos, 0);
}

TEST_F(PrincipledImagesTest, CoatsHaveNormalsOfTheirOwn) {
  const TangentPlane plane{{0, 0, 1}, {2, 0, 0}, {0, 3, 0}, true};
  MaterialDescription description = DescribedAs(Layered());
  std::get<PrincipledMaterial>(description.material).coat.value = 1;
  const auto [textures, paths] = Texel({0.8f, 0.5f, 0.9f});
  description.normal_map = 0;
  EXPECT_FALSE(
      BuildOne(description, textures, paths)->CoatNormal(0, kTexturedPoint, 0, plane).has_value());
  description.coat_normals = CoatNormals{};
  EXPECT_EQ(BuildOne(description, textures, paths)->CoatNormal(0, kTexturedPoint, 0, plane),
            (Vec3f{0, 0, 1}));
  description.coat_normals = CoatNormals{.map = 0, .scale = 0.5f};
  const auto n = BuildOne(description, textures, paths)->CoatNormal(0, kTexturedPoint, 0, plane);
  ASSERT_TRUE(n.has_value());
  EXPECT_NEAR(n->x / n->z, 0.5 * 0.6 / 0.8, 1e-5);
  EXPECT_EQ(n->y, 0);
}

// A coat about its own normal reflects as an upright one, seen from there.
TEST(PrincipledTexturesTest, TiltedCoats) {
  PrincipledMaterial material = Layered();
  material.base_color.value.rgb = {};
  material.specular.value = 0;
  material.coat.value = 1;
  material.coat_roughness.value = 0.3f;
  MaterialDescription description = DescribedAs(material);
  description.coat_normals = CoatNormals{};
  const auto table = BuildOne(description, {});
  ASSERT_NE(table, nullptr);
  const Bsdf upright = table->Evaluate<kAllTraits>(0, kTexturedPoint, 0);
  Bsdf tilted = upright;
  tilted.coat_tilt = CoatTilt::Of(Normalize(Vec3f{0.3f, -0.2f, 1}));
  const Frame frame = Frame::FromNormal(tilted.coat_tilt.Normal());
  const Vec3f wo = Normalize(Vec3f{0.5f, 0.1f, 0.86f}), wi = Normalize(Vec3f{0.1f, -0.4f, 0.8f});
  const float value = EvalBsdf<kAllTraits>(tilted, wo, wi).f_cos.g;
  const float expected =
      EvalBsdf<kAllTraits>(upright, frame.ToLocal(wo), frame.ToLocal(wi)).f_cos.g;
  EXPECT_GT(value, 0.01f);
  EXPECT_NEAR(value / expected, 1, 1e-4);
  // From below, the surface is turned over with its coat.
  const Vec3f below_o = -wo, below_i = -wi;
  EXPECT_NEAR(EvalBsdf<kAllTraits>(tilted, below_o, below_i).f_cos.g / value, 1, 1e-4);
}

}  // namespace
}  // namespace sheaf::render
