// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneReaderLimits: how large a scene may be that is read.
#pragma once

#include <cstdint>
#include <string>

namespace sheaf {

struct SceneReaderLimits {
  uint64_t triangles_max = uint64_t{1} << 31;
  uint64_t memory_bytes_max = uint64_t{16} << 30;  // Size of the description.
  std::string memory_limit = "memory_bytes_max";   // The origin of that limit, for messages.
  uint32_t include_depth_max = 64;
  // Files that include each other twice double at each level, and each line may name a large file.
  uint32_t inclusions_max = 100'000;
  uint64_t repeated_bytes_max = uint64_t{4} << 30;  // Read or copied of files read before.
  uint32_t mix_depth_max = 64;                      // Mix materials within each other.
  // A glTF file may claim what its bytes do not have, or the same bytes many times: its content
  // takes at most this, and the factor times the bytes of its files.
  uint64_t expansion_bytes = uint64_t{256} << 20;
  uint64_t expansion_factor = 256;
  uint64_t placements_max =
      50'000'000;  // Placements of a glTF file's primitives, by nodes and instances.
  uint64_t file_bytes_max = uint64_t{8} << 30;
  uint32_t errors_max = 50;  // Reading stops after this many.
  uint32_t notes_max = 200;  // Further notes and warnings are dropped.
};

}  // namespace sheaf
