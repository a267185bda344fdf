// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Textures of what the extensions of materials add: channels, ranges and directions are those of
// the extensions' specifications.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <variant>

#include "absl/strings/str_cat.h"
#include "common/scene/scene_description.h"
#include "tests/support/gltf_text.h"

namespace sheaf {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

absl::StatusOr<ReadSceneResult> ReadLayers(const std::string& members) {
  return testing::Read(testing::File(absl::StrCat(R"("materials": [{)", members, R"(}],
      "textures": [{"source": 0}, {"source": 0}], "images": [{"uri": "wood.png"}],
      "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}])")));
}

const PrincipledMaterial& LayersOf(const ReadSceneResult& read) {
  return std::get<PrincipledMaterial>(read.scene.materials[0].material);
}
const TextureDescription& TextureOf(const ReadSceneResult& read, int32_t texture) {
  return read.scene.textures.at(static_cast<size_t>(texture));
}
void ExpectChannel(const ReadSceneResult& read, const FloatInput& input, int channel, float scale) {
  ASSERT_NE(input.texture, kNone);
  const auto& image = std::get<ImageTexture>(TextureOf(read, input.texture).texture);
  EXPECT_EQ(image.channel, channel);
  EXPECT_EQ(image.scale, scale);
  EXPECT_EQ(image.encoding, ColorEncoding::kLinear);
}

TEST(GltfLayerTexturesTest, RoughnessOfCoatAndSheen) {
  const auto read = ReadLayers(R"("extensions": {
      "KHR_materials_clearcoat": {"clearcoatFactor": 1, "clearcoatRoughnessFactor": 0.5,
                                  "clearcoatRoughnessTexture": {"index": 0}},
      "KHR_materials_sheen": {"sheenColorFactor": [1, 1, 1], "sheenRoughnessFactor": 0.25,
                              "sheenRoughnessTexture": {"index": 0}}})");
  ASSERT_TRUE(read.ok()) << read.status();
  ExpectChannel(*read, LayersOf(*read).coat_roughness, 1, 0.5f);
  ExpectChannel(*read, LayersOf(*read).sheen_roughness, 3, 0.25f);
  EXPECT_THAT(testing::Notes(*read), Not(HasSubstr("has no effect")));
}

TEST(GltfLayerTexturesTest, StrengthAndDirectionOfAnisotropy) {
  const auto read = ReadLayers(R"("extensions": {"KHR_materials_anisotropy": {
      "anisotropyStrength": 0.5, "anisotropyRotation": 0.75, "anisotropyTexture": {"index": 1}}})");
  ASSERT_TRUE(read.ok()) << read.status();
  const PrincipledMaterial& material = LayersOf(*read);
  ExpectChannel(*read, material.anisotropy, 2, 0.5f);
  EXPECT_EQ(material.rotation_radians.value, 0.75f);
  ASSERT_NE(material.anisotropy_direction, kNone);
  const TextureDescription& direction = TextureOf(*read, material.anisotropy_direction);
  EXPECT_TRUE(direction.is_color);
  EXPECT_EQ(std::get<ImageTexture>(direction.texture).encoding, ColorEncoding::kLinear);
}

TEST(GltfLayerTexturesTest, ThicknessOfFilmsLiesBetweenItsEnds) {
  const auto read = ReadLayers(R"("extensions": {"KHR_materials_iridescence": {
      "iridescenceFactor": 1, "iridescenceThicknessMinimum": 500,
      "iridescenceThicknessMaximum": 200, "iridescenceThicknessTexture": {"index": 0}}})");
  ASSERT_TRUE(read.ok()) << read.status();
  const PrincipledMaterial& material = LayersOf(*read);
  ASSERT_NE(material.iridescence_thickness_nm.texture, kNone);
  const auto& mix =
      std::get<MixTexture>(TextureOf(*read, material.iridescence_thickness_nm.texture).texture);
  EXPECT_EQ(mix.value[0].value, 500);
  EXPECT_EQ(mix.value[1].value, 200);
  ExpectChannel(*read, mix.amount, 1, 1);
  EXPECT_EQ(material.film_least_nm, 200);
  EXPECT_EQ(material.film_most_nm, 500);
}

// Without a normal texture of its own a coat is smooth, whatever the base's one.
TEST(GltfLayerTexturesTest, NormalsOfCoats) {
  const auto with = [](const std::string& base, const std::string& coat) {
    return ReadLayers(absl::StrCat(base, R"("extensions": {"KHR_materials_clearcoat": {
        "clearcoatFactor": 1)",
                                   coat, "}}"));
  };
  const std::string base = R"("normalTexture": {"index": 0},)";
  const auto smooth = with(base, "");
  ASSERT_TRUE(smooth.ok()) << smooth.status();
  ASSERT_TRUE(smooth->scene.materials[0].coat_normals.has_value());
  EXPECT_EQ(smooth->scene.materials[0].coat_normals->map, kNone);
  const auto same = with(base, R"(, "clearcoatNormalTexture": {"index": 0})");
  ASSERT_TRUE(same.ok()) << same.status();
  EXPECT_FALSE(same->scene.materials[0].coat_normals.has_value());
  for (const std::string& other : {base, std::string()}) {
    const auto read = with(other, R"(, "clearcoatNormalTexture": {"index": 1, "scale": 0.5})");
    ASSERT_TRUE(read.ok()) << read.status();
    const MaterialDescription& material = read->scene.materials[0];
    ASSERT_TRUE(material.coat_normals.has_value());
    EXPECT_NE(material.coat_normals->map, kNone);
    EXPECT_EQ(material.coat_normals->scale, 0.5f);
  }
  const auto none = with("", "");
  ASSERT_TRUE(none.ok()) << none.status();
  EXPECT_FALSE(none->scene.materials[0].coat_normals.has_value());
}

}  // namespace
}  // namespace sheaf
