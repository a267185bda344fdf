// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the glTF reader as a .gltf or .glb file with a buffer and an image
// beside it. Memory is bounded by the reader's limits.
#include <cmath>
#include <string>
#include <variant>

#include "common/scene/file_source.h"
#include "common/scene/gltf/gltf_reader.h"
#include "tests/fuzz/fuzz_target.h"

namespace sheaf {

SHEAF_FUZZ_TARGET(gltf) {
  const testing::MemoryFile main_file(bytes), buffer(std::string(256, '\0')), image("\x89PNG");
  const std::string derived = image.Path();
  TableFileSource files({{"main.gltf", main_file.Path()},
                         {"a.bin", buffer.Path()},
                         {"a.png", derived},
                         {"main.gltf.image-0.png", derived}});
  SceneReaderLimits limits;
  limits.file_bytes_max = uint64_t{1} << 22;
  limits.memory_bytes_max = uint64_t{1} << 24;
  limits.triangles_max = 100000;
  GltfView view;
  view.time_s = 0.5;
  view.shutter_s = 0.1;
  const auto read = ReadGltf("main.gltf", files, view, limits);
  if (!read.ok()) return;
  // Accepted scenes contain no dangling references.
  const SceneDescription& scene = read->scene;
  for (const TriangleMesh& mesh : scene.meshes) {
    for (const uint32_t index : mesh.indices) SHEAF_CHECK(index < mesh.positions.size());
    for (const Vec3f& p : mesh.positions) {
      SHEAF_CHECK(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z));
    }
    for (const VertexStep& step : mesh.steps) {
      SHEAF_CHECK(step.positions.size() == mesh.positions.size());
    }
    SHEAF_CHECK(mesh.normals.empty() || mesh.normals.size() == mesh.positions.size());
    SHEAF_CHECK(mesh.uvs.empty() || mesh.uvs.size() == mesh.positions.size());
  }
  const auto valid = [](int32_t index, size_t size) {
    return index >= 0 && static_cast<size_t>(index) < size;
  };
  for (const ShapeDescription& shape : scene.shapes) {
    SHEAF_CHECK(valid(std::get<MeshShape>(shape.shape).mesh, scene.meshes.size()));
    SHEAF_CHECK(valid(shape.material, scene.materials.size()));
    SHEAF_CHECK(shape.area_light == kNone || valid(shape.area_light, scene.area_lights.size()));
  }
  for (const ObjectInstance& instance : scene.instances) {
    SHEAF_CHECK(valid(instance.object, scene.objects.size()));
  }
}

}  // namespace sheaf
