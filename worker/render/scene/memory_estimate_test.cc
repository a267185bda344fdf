// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/scene/memory_estimate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sheaf::render {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

SceneDescription SceneOfMesh(size_t triangles) {
  SceneDescription scene;
  scene.meshes.emplace_back();
  scene.meshes[0].indices.resize(3 * triangles);
  ShapeDescription shape;
  MeshShape mesh;
  mesh.mesh = 0;
  shape.shape = mesh;
  shape.location.line = 7;
  scene.shapes.push_back(shape);
  return scene;
}

TEST(MemoryEstimateTest, GrowsWithInstances) {
  TableFileSource files({});
  const MemoryEstimate once = EstimateMemory(SceneOfMesh(1000), files);
  EXPECT_EQ(once.triangle_count, 1000u);
  EXPECT_EQ(once.largest.line, 7u);
  EXPECT_EQ(once.largest_bytes, once.TotalBytes());
  SceneDescription twice = SceneOfMesh(1000);
  twice.shapes.push_back(twice.shapes[0]);  // A mesh is baked once for each shape that uses it.
  EXPECT_EQ(EstimateMemory(twice, files).TotalBytes(), 2 * once.TotalBytes());
  SceneDescription instanced = SceneOfMesh(1000);
  instanced.objects.emplace_back();
  instanced.instances.resize(50);
  for (ObjectInstance& instance : instanced.instances) instance.object = 0;
  const uint64_t total = EstimateMemory(instanced, files).TotalBytes();
  EXPECT_GT(total, once.TotalBytes());
  EXPECT_LT(total, 2 * once.TotalBytes()) << "instances share their triangles";
}

TEST(MemoryEstimateTest, CountsVolumes) {
  TableFileSource files({});
  SceneDescription scene;
  scene.media.emplace_back();
  UniformGridMedium grid;
  grid.density.resize(1 << 20);
  scene.media[0].kind = grid;
  EXPECT_EQ(EstimateMemory(scene, files).volume_bytes, uint64_t{4} << 20);
  EXPECT_THAT(FormatMemoryEstimate(EstimateMemory(scene, files)), HasSubstr("volumes 4 MiB"));
  VolumeFileMedium volume;
  volume.file = "gone.nvdb";
  scene.media[0].kind = volume;
  EXPECT_EQ(EstimateMemory(scene, files).volume_bytes, 0u);
}

TEST(MemoryEstimateTest, LargeFilesOfVolumesCouldBePaged) {
  MemoryEstimate estimate;
  estimate.volume_bytes = estimate.unpaged_bytes = uint64_t{3} << 30;
  EXPECT_THAT(PageFileNote(estimate), HasSubstr("3.0 GiB of these: submit and render"));
  EXPECT_THAT(FormatMemoryEstimate(estimate), Not(HasSubstr("pages of volumes")));
  estimate.has_pages = true;
  EXPECT_THAT(FormatMemoryEstimate(estimate), HasSubstr("pages of volumes, up to 512 MiB"));
  estimate.unpaged_bytes = uint64_t{1} << 20;
  EXPECT_EQ(PageFileNote(estimate), "");
}

}  // namespace
}  // namespace sheaf::render
