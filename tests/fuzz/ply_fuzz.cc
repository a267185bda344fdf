// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the PLY reader. Memory is bounded by the reader's limits. Build with
// -fsanitize=fuzzer,address.
#include <sys/mman.h>
#include <unistd.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include "common/base/check.h"
#include "common/scene/formats/ply_reader.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size_bytes) {
  const int descriptor = ::memfd_create("fuzz", 0);
  SHEAF_CHECK(descriptor >= 0);
  SHEAF_CHECK(::write(descriptor, bytes, size_bytes) == static_cast<ssize_t>(size_bytes));
  sheaf::SceneReaderLimits limits;
  limits.file_bytes_max = uint64_t{1} << 22;
  limits.memory_bytes_max = uint64_t{1} << 24;
  limits.triangles_max = 1000000;
  const auto mesh = sheaf::ReadPly("/proc/self/fd/" + std::to_string(descriptor), limits);
  ::close(descriptor);
  if (!mesh.ok()) return 0;
  // Accepted meshes are valid.
  for (const uint32_t index : mesh->indices) SHEAF_CHECK(index < mesh->positions.size());
  for (const sheaf::Vec3f& p : mesh->positions) {
    SHEAF_CHECK(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z));
  }
  SHEAF_CHECK(mesh->normals.empty() || mesh->normals.size() == mesh->positions.size());
  SHEAF_CHECK(mesh->uvs.empty() || mesh->uvs.size() == mesh->positions.size());
  return 0;
}
