// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the scene reader as a main file that may also include itself and use a
// small mesh. Memory is bounded by the reader's limits. Build with -fsanitize=fuzzer,address.
#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <string>

#include "common/base/check.h"
#include "common/scene/file_source.h"
#include "common/scene/pbrt/scene_reader.h"

namespace {

// A file in memory that can be opened by path.
class MemoryFile {
 public:
  MemoryFile(const void* bytes, size_t size_bytes) : descriptor_(::memfd_create("fuzz", 0)) {
    SHEAF_CHECK(descriptor_ >= 0);
    SHEAF_CHECK(::write(descriptor_, bytes, size_bytes) == static_cast<ssize_t>(size_bytes));
  }
  ~MemoryFile() { ::close(descriptor_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  std::string Path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

 private:
  int descriptor_;
};

constexpr char kMesh[] =
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
    "z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
constexpr char kIncluded[] = "Translate 1 0 0\nAttributeBegin\nShape \"sphere\"\nAttributeEnd\n";

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size_bytes) {
  const MemoryFile main_file(bytes, size_bytes);
  const MemoryFile mesh(kMesh, sizeof kMesh - 1);
  const MemoryFile included(kIncluded, sizeof kIncluded - 1);
  sheaf::TableFileSource files(
      {{"main.pbrt", main_file.Path()}, {"a.pbrt", included.Path()}, {"m.ply", mesh.Path()}});
  sheaf::SceneReaderLimits limits;
  limits.file_bytes_max = uint64_t{1} << 22;
  limits.memory_bytes_max = uint64_t{1} << 24;
  limits.triangles_max = 100000;
  const auto result = sheaf::ReadScene("main.pbrt", files, limits);
  // Accepted scenes contain no dangling references.
  if (result.ok()) {
    for (const auto& shape : result->scene.shapes) {
      SHEAF_CHECK(shape.material >= 0 &&
                  shape.material < static_cast<int32_t>(result->scene.materials.size()));
    }
    for (const auto& mesh : result->scene.bilinear_meshes) {
      SHEAF_CHECK(mesh.indices.size() % 4 == 0);
      for (const uint32_t index : mesh.indices) SHEAF_CHECK(index < mesh.positions.size());
    }
  }
  return 0;
}
