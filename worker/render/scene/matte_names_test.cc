// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/scene/matte_names.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "common/film/cryptomatte.h"

namespace sheaf::render {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Two unnamed diffuse materials and "wood".
SceneDescription MakeScene() {
  SceneDescription scene;
  scene.materials.resize(3);
  scene.materials[0].material = scene.materials[1].material = DiffuseMaterial{};
  scene.materials[2].material = DielectricMaterial{};
  scene.materials[2].name = "wood";
  return scene;
}

void AddShape(SceneDescription* scene, int32_t material, const std::string& name = "") {
  ShapeDescription shape;
  shape.shape = SphereShape{};
  shape.material = material;
  shape.location = {0, static_cast<int32_t>(scene->shapes.size()), 1};
  if (!name.empty()) {
    shape.matte_name = static_cast<int32_t>(scene->matte_names.size());
    scene->matte_names.push_back(name);
  }
  scene->world_shapes.push_back(static_cast<int32_t>(scene->shapes.size()));
  scene->shapes.push_back(shape);
}

std::vector<std::string> ShapeNames(const SceneDescription& scene) {
  const MatteNames names(scene);
  std::vector<std::string> found;
  for (size_t i = 0; i < scene.shapes.size(); ++i) found.push_back(names.OfShape(scene, i));
  return found;
}

TEST(MatteNamesTest, NamesComeFromTheSceneOrFromMaterials) {
  SceneDescription scene = MakeScene();
  AddShape(&scene, 2);
  AddShape(&scene, 0, "Ball");
  AddShape(&scene, 2);
  AddShape(&scene, 0);
  AddShape(&scene, kNone);
  EXPECT_THAT(ShapeNames(scene), ElementsAre("wood.sphere#1", "Ball", "wood.sphere#2",
                                             "diffuse.sphere#1", "none.sphere#1"));
  const MatteNames names(scene);
  EXPECT_EQ(names.OfMaterial(scene, 0), "diffuse#1");
  EXPECT_EQ(names.OfMaterial(scene, 1), "diffuse#2");
  EXPECT_EQ(names.OfMaterial(scene, 2), "wood");
}

TEST(MatteNamesTest, LinesChangeNoName) {
  SceneDescription scene = MakeScene();
  AddShape(&scene, 2);
  AddShape(&scene, 0);
  const std::vector<std::string> before = ShapeNames(scene);
  for (ShapeDescription& shape : scene.shapes) shape.location.line += 7;
  EXPECT_EQ(ShapeNames(scene), before);
}

TEST(MatteNamesTest, InstancesAreNumberedByObject) {
  SceneDescription scene = MakeScene();
  AddShape(&scene, 0);
  scene.world_shapes.clear();
  scene.objects = {{"tree", {0}, {}}};
  scene.matte_names = {"Oak"};
  scene.instances.resize(3);
  for (ObjectInstance& instance : scene.instances) instance.object = 0;
  scene.instances[1].matte_name = 0;
  const MatteNames names(scene);
  EXPECT_EQ(names.OfInstance(scene, 0), "tree#1");
  EXPECT_EQ(names.OfInstance(scene, 1), "Oak");
  EXPECT_EQ(names.OfInstance(scene, 2), "tree#2");
}

TEST(MatteNamesTest, TakenNamesAreLeftOut) {
  SceneDescription scene = MakeScene();
  AddShape(&scene, 2);
  AddShape(&scene, 2, "wood.sphere#1");
  AddShape(&scene, 2);
  EXPECT_THAT(ShapeNames(scene), ElementsAre("wood.sphere#2", "wood.sphere#1", "wood.sphere#3"));
}

TEST(MatteNamesTest, EqualIdsOfTwoNamesAreReported) {
  SceneDescription scene = MakeScene();
  AddShape(&scene, 2, "Ball");
  EXPECT_THAT(MatteCollisions(scene), IsEmpty());
  // Found by a search over numbers.
  const std::string one = "name 34406", two = "name 111945";
  ASSERT_EQ(CryptomatteIdBits(one), CryptomatteIdBits(two));
  AddShape(&scene, 2, one);
  AddShape(&scene, 2, two);
  ASSERT_EQ(MatteCollisions(scene).size(), 1u);
  EXPECT_THAT(MatteCollisions(scene)[0], HasSubstr("rename"));
}

}  // namespace
}  // namespace sheaf::render
