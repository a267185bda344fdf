// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EmbreeScene::PassageOf: shadow rays among opaque surfaces and such that let them pass, against a
// walk from one nearest hit to the next.
#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "common/math/transform.h"
#include "gtest/gtest.h"
#include "tests/support/test_scene.h"
#include "tests/support/traced_scene.h"

namespace sheaf::render {
namespace {

Vec3f PointIn(float reach, Random* random) {
  Vec3f p;
  for (size_t i = 0; i < 3; ++i) {
    p[i] = reach * (2 * static_cast<float>(random->Uniform()) - 1);
  }
  return p;
}

// Triangles of all widths, spheres and disks, each opaque or an interface.
SceneDescription Clutter(Random* random) {
  TestScene t({0, 0, 0}, {0, 0, 1}, 60);
  const int32_t materials[] = {t.Diffuse(Rgb::Gray(0.5f)), t.AddMaterial(InterfaceMaterial{})};
  for (int i = 0; i < 24; ++i) {
    const int32_t material = materials[i % 2];
    const Vec3f a = PointIn(1, random), b = a + PointIn(0.7f, random);
    // Down to needles, which are intersected in double.
    const auto width = static_cast<float>(std::exp2(-14 * random->Uniform()));
    t.AddShape(MeshShape{t.AddMesh({a, b, b + PointIn(width, random)}, {0, 1, 2})}, material);
    const Vec3d place = ToDouble(PointIn(1, random));
    if (i % 6 < 2)
      t.AddShape(SphereShape{0.15f, -0.15f, 0.15f, 360}, material, TranslateMatrix(place));
    if (i % 6 == 2 || i % 6 == 3) {
      DiskShape disk;
      disk.radius = 0.2f;
      t.AddShape(disk, material, TranslateMatrix(place));
    }
  }
  return std::move(t.scene);
}

bool LetsPass(const SurfacePoint& point) { return point.surface->may_pass; }

// Whether an opaque surface is on the ray's way, behind any number of interfaces.
bool IsBlocked(const TracedScene& scene, Ray ray, Vec3f end) {
  RawHit hit;
  while (scene.tracer->Intersect(ray, &hit)) {
    const SurfacePoint point = MakeSurfacePoint<kAllTraits>(scene.geometry, ray, hit);
    if (!LetsPass(point)) return true;
    Leave(point, ray.d, &ray);
    if (std::isfinite(ray.t_max)) ray.d = end - ray.o;
  }
  return false;
}

TEST(PassageTest, AgreesWithAWalkFromHitToHit) {
  Random random(11);
  int open = 0, blocked = 0, unknown = 0, behind_interfaces = 0;
  for (int i = 0; i < 40; ++i) {
    const std::unique_ptr<TracedScene> scene = Traced(Clutter(&random));
    for (int k = 0; k < 500; ++k) {
      Ray ray;
      ray.o = PointIn(1.2f, &random);
      const Vec3f end = PointIn(1.2f, &random);
      ray.d = end - ray.o;
      if (k % 2 == 0) {
        ray.t_max = 1;
        ray.end = Ray::End::kFree;
      }
      const Passage passage = scene->tracer->PassageOf(ray);
      RawHit hit;
      const bool is_hit = scene->tracer->Intersect(ray, &hit);
      open += passage == Passage::kOpen;
      blocked += passage == Passage::kBlocked;
      unknown += passage == Passage::kUnknown;
      if (passage != Passage::kUnknown) {
        EXPECT_EQ(is_hit, passage == Passage::kBlocked);
      }
      if (!is_hit) continue;
      const bool passes = LetsPass(MakeSurfacePoint<kAllTraits>(scene->geometry, ray, hit));
      if (passage == Passage::kBlocked) {
        EXPECT_TRUE(IsBlocked(*scene, ray, end));
        behind_interfaces += passes;
      }
    }
  }
  // All answers occur, and a ray that no interface meets is rarely left unknown.
  EXPECT_GT(open, 2000);
  EXPECT_GT(blocked, 2000);
  EXPECT_GT(unknown, 2000);
  EXPECT_GT(behind_interfaces, 0);
}

// Where no surface lets rays pass, the answer is that of Occluded.
TEST(PassageTest, IsKnownAmongOpaqueSurfaces) {
  Random random(12);
  int unknown = 0;
  for (int i = 0; i < 20; ++i) {
    SceneDescription clutter = Clutter(&random);
    for (ShapeDescription& shape : clutter.shapes) shape.material = 0;
    const std::unique_ptr<TracedScene> scene = Traced(std::move(clutter));
    for (int k = 0; k < 500; ++k) {
      Ray ray;
      ray.o = PointIn(1.2f, &random);
      ray.d = random.Direction();
      const Passage passage = scene->tracer->PassageOf(ray);
      unknown += passage == Passage::kUnknown;
      if (passage == Passage::kUnknown) continue;
      EXPECT_EQ(scene->tracer->Occluded(ray), passage == Passage::kBlocked);
    }
  }
  EXPECT_LE(unknown, 10);  // Rays to the edges of triangles.
}

}  // namespace
}  // namespace sheaf::render
