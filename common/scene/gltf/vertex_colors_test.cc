// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <variant>

#include "common/scene/scene_description.h"
#include "tests/support/gltf_text.h"

namespace sheaf {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

// The corners have the colors (0, 0, 0), (1, 0, 0) and so on: their positions.
TEST(GltfMaterialTest, ColorsOfVerticesMultiplyTheBaseColor) {
  const auto read = testing::Read(testing::File(R"("materials": [
    {"alphaMode": "BLEND", "normalTexture": {"index": 0, "scale": 0.5},
     "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1, 0.5]}}],
    "textures": [{"source": 0}], "images": [{"uri": "wood.png"}],
    "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}])",
                                                R"("meshes": [{"primitives": [
    {"attributes": {"POSITION": 0, "COLOR_0": 0}, "indices": 2, "material": 0},
    {"attributes": {"POSITION": 0}, "indices": 2, "material": 0}]}],)"));
  ASSERT_TRUE(read.ok()) << read.status();
  const SceneDescription& scene = read->scene;
  ASSERT_EQ(scene.meshes.size(), 2u);
  ASSERT_EQ(scene.meshes[0].colors.size(), scene.meshes[0].positions.size());
  for (size_t i = 0; i < scene.meshes[0].positions.size(); ++i) {
    const Vec3f p = scene.meshes[0].positions[i];
    EXPECT_EQ(scene.meshes[0].colors[i], (VertexColor{p.x, p.y, p.z, 1}));
  }
  EXPECT_TRUE(scene.meshes[1].colors.empty());
  ASSERT_EQ(scene.materials.size(), 2u);
  const auto& colored = std::get<PrincipledMaterial>(scene.materials[0].material);
  ASSERT_NE(colored.base_color.texture, kNone);
  const auto& times =
      std::get<VertexColorTexture>(scene.textures[colored.base_color.texture].texture);
  EXPECT_EQ(times.color.value.rgb, (Rgb{0.5f, 0.25f, 1}));
  ASSERT_NE(scene.shapes[0].alpha.texture, kNone);
  EXPECT_EQ(std::get<VertexColorTexture>(scene.textures[scene.shapes[0].alpha.texture].texture)
                .value.value,
            0.5f);
  EXPECT_EQ(std::get<PrincipledMaterial>(scene.materials[1].material).base_color.texture, kNone);
  EXPECT_EQ(scene.shapes[1].alpha.texture, kNone);
  EXPECT_EQ(scene.materials[0].normal_scale, 0.5f);
  EXPECT_THAT(testing::Notes(*read), Not(HasSubstr("scale of its normal map")));
}

}  // namespace
}  // namespace sheaf
