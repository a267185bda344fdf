// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the PLY reader. Memory is bounded by the reader's limits.
#include <cmath>

#include "common/scene/formats/ply_reader.h"
#include "tests/fuzz/fuzz_target.h"

namespace sheaf {

SHEAF_FUZZ_TARGET(ply) {
  const testing::MemoryFile file(bytes);
  SceneReaderLimits limits;
  limits.file_bytes_max = uint64_t{1} << 22;
  limits.memory_bytes_max = uint64_t{1} << 24;
  limits.triangles_max = 1000000;
  const auto read = ReadPly(file.Path(), limits);
  if (!read.ok()) return;
  const TriangleMesh* mesh = &read->mesh;
  // Accepted meshes are valid.
  for (const uint32_t index : mesh->indices) SHEAF_CHECK(index < mesh->positions.size());
  for (const Vec3f& p : mesh->positions) {
    SHEAF_CHECK(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z));
  }
  SHEAF_CHECK(mesh->normals.empty() || mesh->normals.size() == mesh->positions.size());
  SHEAF_CHECK(mesh->uvs.empty() || mesh->uvs.size() == mesh->positions.size());
}

}  // namespace sheaf
