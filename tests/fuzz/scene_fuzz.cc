// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the scene reader as a main file that may also include itself and use a
// small mesh. Memory is bounded by the reader's limits.
#include <cstdint>

#include "common/scene/file_source.h"
#include "common/scene/pbrt/scene_reader.h"
#include "tests/fuzz/fuzz_target.h"

namespace sheaf {
namespace {

constexpr char kMesh[] =
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
    "z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
constexpr char kIncluded[] = "Translate 1 0 0\nAttributeBegin\nShape \"sphere\"\nAttributeEnd\n";

}  // namespace

SHEAF_FUZZ_TARGET(scene) {
  const testing::MemoryFile main_file(bytes), mesh(kMesh), included(kIncluded);
  TableFileSource files(
      {{"main.pbrt", main_file.Path()}, {"a.pbrt", included.Path()}, {"m.ply", mesh.Path()}});
  SceneReaderLimits limits;
  limits.file_bytes_max = uint64_t{1} << 22;
  limits.memory_bytes_max = uint64_t{1} << 24;
  limits.triangles_max = 100000;
  const auto result = ReadScene("main.pbrt", files, limits);
  // Accepted scenes contain no dangling references.
  if (result.ok()) {
    for (const auto& shape : result->scene.shapes) {
      SHEAF_CHECK(shape.material >= 0 &&
                  shape.material < static_cast<int32_t>(result->scene.materials.size()));
    }
    for (const auto& patches : result->scene.bilinear_meshes) {
      SHEAF_CHECK(patches.indices.size() % 4 == 0);
      for (const uint32_t index : patches.indices) SHEAF_CHECK(index < patches.positions.size());
    }
  }
}

}  // namespace sheaf
