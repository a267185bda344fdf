// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Materials of other kinds than the core format's, and what their textures need of the mesh.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <variant>

#include "absl/strings/str_cat.h"
#include "common/scene/scene_description.h"
#include "tests/support/gltf_text.h"

namespace sheaf {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kPlaced[] = R"("nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}])";
constexpr char kImage[] = R"("textures": [{"source": 0}], "images": [{"uri": "wood.png"}],)";

std::string MeshOf(const std::string& attributes) {
  return absl::StrCat(R"("meshes": [{"primitives": [{"attributes": {"POSITION": 0, )", attributes,
                      R"(}, "indices": 2, "material": 0}]}],)");
}

absl::StatusOr<ReadSceneResult> ReadMaterial(const std::string& material,
                                             const std::string& mesh = testing::kMesh) {
  return testing::Read(
      testing::File(absl::StrCat("\"materials\": [", material, "], ", kImage, kPlaced), mesh));
}

const PrincipledMaterial& Principled(const SceneDescription& scene) {
  return std::get<PrincipledMaterial>(scene.materials[0].material);
}
const ImageTexture& ImageOf(const SceneDescription& scene, int32_t texture) {
  return std::get<ImageTexture>(scene.textures[static_cast<size_t>(texture)].texture);
}

TEST(GltfMaterialKindsTest, TexturesUseEitherSetOfUv) {
  const auto read = ReadMaterial(R"({"normalTexture": {"index": 0, "texCoord": 1},
      "pbrMetallicRoughness": {"baseColorTexture": {"index": 0},
                               "metallicRoughnessTexture": {"index": 0, "texCoord": 1}}})",
                                 MeshOf(R"("TEXCOORD_0": 1, "TEXCOORD_1": 1)"));
  ASSERT_TRUE(read.ok()) << read.status();
  const SceneDescription& scene = read->scene;
  // The normal map's set is that of the mesh, from which its tangents follow.
  EXPECT_EQ(ImageOf(scene, Principled(scene).base_color.texture).mapping.kind,
            UvMapping::Kind::kSecondUv);
  EXPECT_EQ(ImageOf(scene, Principled(scene).roughness.texture).mapping.kind, UvMapping::Kind::kUv);
  EXPECT_EQ(ImageOf(scene, scene.materials[0].normal_map).mapping.kind, UvMapping::Kind::kUv);
  ASSERT_EQ(scene.meshes[0].colors.size(), 3u);
  EXPECT_EQ(scene.meshes[0].colors[2], (VertexColor{0, 0, 1, 1}));
  EXPECT_THAT(testing::Notes(*read), Not(HasSubstr("TEXCOORD")));
}

TEST(GltfMaterialKindsTest, ASecondSetOfUvBesideColorsIsLeftOut) {
  const auto read = ReadMaterial(R"({"normalTexture": {"index": 0, "texCoord": 1},
      "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})",
                                 MeshOf(R"("TEXCOORD_0": 1, "TEXCOORD_1": 1, "COLOR_0": 0)"));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_THAT(testing::Notes(*read),
              HasSubstr("uses TEXCOORD_0 beside TEXCOORD_1 and colors of vertices"));
}

TEST(GltfMaterialKindsTest, TangentsAreThoseOfTheFile) {
  std::string accessors = testing::kAccessors;
  accessors.replace(accessors.find(R"("count": 2, "type": "VEC4")"), 26,
                    R"("count": 3, "type": "VEC4")");
  accessors.replace(accessors.find(R"("bufferView": 5)"), 15, R"("bufferView": 6)");
  accessors.replace(accessors.find(R"("byteOffset": 100, "byteLength": 32})"), 36,
                    R"("byteOffset": 100, "byteLength": 32},
                       {"buffer": 0, "byteOffset": 76, "byteLength": 48})");
  const auto read = testing::Read(testing::File(absl::StrCat(R"("materials": [{}], )", kPlaced),
                                                MeshOf(R"("TANGENT": 5)"), accessors));
  ASSERT_TRUE(read.ok()) << read.status();
  // The numbers of the buffer from its translations on.
  ASSERT_EQ(read->scene.meshes[0].tangents.size(), 3u);
  EXPECT_EQ(read->scene.meshes[0].tangents[0], (Vec3f{0, 0, 0}));
  EXPECT_EQ(read->scene.meshes[0].tangents[1], (Vec3f{0, 0, 0}));
  EXPECT_EQ(read->scene.meshes[0].tangents[2], (Vec3f{0, 1, 0}));
}

// Abbe's number is 20 / dispersion; the index at line d is the material's.
TEST(GltfMaterialKindsTest, GlassDisperses) {
  const auto read = ReadMaterial(R"({"pbrMetallicRoughness": {"metallicFactor": 0,
      "roughnessFactor": 0.5}, "extensions": {
      "KHR_materials_transmission": {"transmissionFactor": 1},
      "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 0.5,
                               "attenuationColor": [0.25, 1, 1]},
      "KHR_materials_ior": {"ior": 1.6}, "KHR_materials_dispersion": {"dispersion": 2}}})");
  ASSERT_TRUE(read.ok()) << read.status();
  const auto& glass = std::get<DielectricMaterial>(read->scene.materials[0].material);
  EXPECT_EQ(glass.roughness.u.value, 0.25f);
  EXPECT_FALSE(glass.roughness.remap_roughness);
  EXPECT_EQ(glass.eta.mean, 1.6f);
  ASSERT_TRUE(glass.eta.Disperses());
  const ColorSpec& index = glass.eta.spectrum;
  const auto at = [&](double nm) {
    size_t i = 0;
    while (index.wavelengths_nm[i + 1] < nm) ++i;
    const double t = (nm - static_cast<double>(index.wavelengths_nm[i])) /
                     static_cast<double>(index.wavelengths_nm[i + 1] - index.wavelengths_nm[i]);
    return (1 - t) * static_cast<double>(index.values[i]) +
           t * static_cast<double>(index.values[i + 1]);
  };
  EXPECT_NEAR(at(587.56), 1.6, 1e-4);
  EXPECT_NEAR((at(587.56) - 1) / (at(486.13) - at(656.27)), 10, 0.05);
  // Its inside absorbs as before.
  ASSERT_EQ(read->scene.media.size(), 1u);
  EXPECT_EQ(read->scene.shapes[0].media.inside, 0);
}

// Light that crosses the thickness once is tinted where it enters and where it leaves.
TEST(GltfMaterialKindsTest, BaseColorsOfGlassThatDispersesAreAbsorbed) {
  const auto read = ReadMaterial(R"({"pbrMetallicRoughness": {"metallicFactor": 0,
      "baseColorFactor": [0.5, 1, 0.8, 1]}, "extensions": {
      "KHR_materials_transmission": {"transmissionFactor": 1},
      "KHR_materials_volume": {"thicknessFactor": 2, "attenuationDistance": 1,
                               "attenuationColor": [1, 0.5, 1]},
      "KHR_materials_dispersion": {"dispersion": 2}}})");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_TRUE(std::holds_alternative<DielectricMaterial>(read->scene.materials[0].material));
  ASSERT_EQ(read->scene.media.size(), 1u);
  const Rgb sigma_a = read->scene.media[0].sigma_a.rgb;
  const double expected[] = {0.25, 0.25, 0.64};
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(std::exp(-2 * static_cast<double>(sigma_a[c])), expected[c], 1e-5);
  }
  EXPECT_THAT(testing::Notes(*read), HasSubstr("its base color is absorbed along its thickness"));
}

TEST(GltfMaterialKindsTest, OtherThanPlainGlassDoesNotDisperse) {
  const auto read = ReadMaterial(R"({"pbrMetallicRoughness": {"metallicFactor": 0,
      "baseColorTexture": {"index": 0}}, "extensions": {
      "KHR_materials_transmission": {"transmissionFactor": 1},
      "KHR_materials_volume": {"thicknessFactor": 1},
      "KHR_materials_dispersion": {"dispersion": 2}}})");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_THAT(testing::Notes(*read), HasSubstr("its dispersion has no effect: only glass"));
  EXPECT_TRUE(std::holds_alternative<PrincipledMaterial>(read->scene.materials[0].material));
}

TEST(GltfMaterialKindsTest, SpecularColorsAreThoseOfDielectricsOrOfMetals) {
  const auto of = [](const std::string& members) {
    return ReadMaterial(absl::StrCat(
        R"({"alphaMode": "BLEND", "extensions": {"KHR_materials_pbrSpecularGlossiness": {)",
        members, "}}}"));
  };
  const auto plastic = of(R"("diffuseFactor": [0.5, 0.25, 0, 0.75],
      "specularFactor": [0.04, 0.02, 0], "glossinessFactor": 0.75)");
  ASSERT_TRUE(plastic.ok()) << plastic.status();
  const PrincipledMaterial& p = Principled(plastic->scene);
  EXPECT_EQ(p.base_color.value.rgb, (Rgb{0.5f, 0.25f, 0}));
  EXPECT_EQ(p.metallic.value, 0);
  EXPECT_EQ(p.roughness.value, 0.25f);
  EXPECT_NEAR(p.ior, 1.5f, 1e-4f);
  EXPECT_NEAR(p.specular_tint.value.rgb.g, 0.5f, 1e-4f);
  EXPECT_EQ(plastic->scene.shapes[0].alpha.value, 0.75f);
  const auto gold = of(R"("diffuseFactor": [0, 0, 0, 1], "specularFactor": [1, 0.75, 0.25])");
  ASSERT_TRUE(gold.ok()) << gold.status();
  EXPECT_EQ(Principled(gold->scene).metallic.value, 1);
  EXPECT_EQ(Principled(gold->scene).base_color.value.rgb, (Rgb{1, 0.75f, 0.25f}));
  EXPECT_EQ(Principled(gold->scene).roughness.value, 0);
}

TEST(GltfMaterialKindsTest, GlossinessIsTheAlphaOfTheSpecularTexture) {
  const auto read = ReadMaterial(R"({"extensions": {"KHR_materials_pbrSpecularGlossiness": {
      "diffuseTexture": {"index": 0}, "specularGlossinessTexture": {"index": 0},
      "glossinessFactor": 0.5}}})");
  ASSERT_TRUE(read.ok()) << read.status();
  const PrincipledMaterial& material = Principled(read->scene);
  ASSERT_NE(material.roughness.texture, kNone);
  const ImageTexture& roughness = ImageOf(read->scene, material.roughness.texture);
  EXPECT_EQ(roughness.channel, 3);
  EXPECT_EQ(roughness.scale, 0.5f);
  EXPECT_TRUE(roughness.invert);
  EXPECT_NE(material.specular_tint.texture, kNone);
  EXPECT_NE(material.base_color.texture, kNone);
  EXPECT_THAT(testing::Notes(*read), HasSubstr("reflect two thirds at most"));
}

}  // namespace
}  // namespace sheaf
