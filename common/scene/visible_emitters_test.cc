// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/visible_emitters.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>

#include "common/math/transform.h"

namespace sheaf {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

// A light 10 units in front of a camera that sees 45 degrees up and down, and twice that sideways.
constexpr int32_t kWidthPx = 100, kHeightPx = 50;
SceneDescription SceneWith(decltype(ShapeDescription::shape) emitter, Vec3d place) {
  SceneDescription scene;
  scene.camera.screen_window[0] = -2;
  scene.camera.screen_window[1] = 2;
  ShapeDescription shape;
  shape.shape = std::move(emitter);
  shape.area_light = 0;
  shape.world_from_object.start = shape.world_from_object.end = TranslateMatrix(place);
  scene.shapes.push_back(shape);
  scene.world_shapes.push_back(0);
  scene.area_lights.emplace_back();
  return scene;
}
std::vector<PixelRect> EmittersOf(const SceneDescription& scene) {
  return VisibleEmitters(scene, kWidthPx, kHeightPx);
}

TEST(VisibleEmittersTest, BoundsMatchTheFilm) {
  // 50 +- 25 * .1 / 10 pixels at the center, and 2.5 to the right and up at a tenth of the depth.
  EXPECT_THAT(EmittersOf(SceneWith(SphereShape{.radius = 0.1f}, {0, 0, 10})),
              ElementsAre(PixelRect{49, 24, 51, 26}));
  EXPECT_THAT(EmittersOf(SceneWith(DiskShape{.radius = 0.1f}, {1, 1, 10})),
              ElementsAre(PixelRect{52, 22, 53, 23}));
  EXPECT_THAT(
      EmittersOf(SceneWith(CylinderShape{.radius = 1, .z_min = 0, .z_max = 10}, {0, 0, 10})),
      ElementsAre(PixelRect{47, 22, 53, 28}));
}

TEST(VisibleEmittersTest, MeshBoundsCoverTheirVertices) {
  SceneDescription scene = SceneWith(MeshShape{.mesh = 0}, {0, 0, 10});
  scene.meshes.emplace_back();
  scene.meshes[0].positions = {{0, 0, 0}, {2, 0, 0}, {0, 1, 0}};
  EXPECT_THAT(EmittersOf(scene), ElementsAre(PixelRect{50, 22, 56, 26}));
  scene.meshes[0].steps.resize(1);  // It deforms.
  EXPECT_THAT(EmittersOf(scene), IsEmpty());
}

TEST(VisibleEmittersTest, OrthographicSizeIgnoresDepth) {
  SceneDescription scene = SceneWith(SphereShape{.radius = 0.1f}, {0, 0, 1000});
  scene.camera.kind = CameraDescription::Kind::kOrthographic;
  EXPECT_THAT(EmittersOf(scene), ElementsAre(PixelRect{47, 22, 53, 28}));
}

TEST(VisibleEmittersTest, OmitsNonEmittersAndShapesNotFullyInFront) {
  EXPECT_THAT(EmittersOf(SceneWith(SphereShape{.radius = 1}, {0, 0, 0.5})), IsEmpty());
  SceneDescription scene = SceneWith(SphereShape{.radius = 1}, {0, 0, 10});
  scene.shapes[0].area_light = kNone;
  EXPECT_THAT(EmittersOf(scene), IsEmpty());
  scene.shapes[0].area_light = 0;
  scene.shapes[0].world_from_object.end = TranslateMatrix({0, 0, 11});  // It moves.
  EXPECT_THAT(EmittersOf(scene), IsEmpty());
  scene.shapes[0].world_from_object.end = scene.shapes[0].world_from_object.start;
  EXPECT_EQ(EmittersOf(scene).size(), 1u);
  scene.camera.kind = CameraDescription::Kind::kEquirectangular;
  EXPECT_THAT(EmittersOf(scene), IsEmpty());
}

}  // namespace
}  // namespace sheaf
