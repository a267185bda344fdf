// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Draco meshes (KHR_draco_mesh_compression). The bytes are untrusted: what a mesh says about its
// size is checked before the decoder takes memory for it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace sheaf::gltf {

// An attribute of a mesh: its unique id, and the type that its numbers get (glTF 2.0 specification,
// sec. 3.6.2.1).
struct DracoAttribute {
  std::string name;
  uint32_t id = 0;
  int component_type = 0;
  size_t components = 0;
};

struct DracoLimits {
  uint64_t triangles_max = 0;
  std::function<bool(uint64_t)> charge;  // False if this many more bytes are too many.
};

struct DracoMesh {
  uint32_t vertices = 0;
  std::vector<uint32_t> indices;  // Three for each triangle, each below `vertices`.
  // As wanted: vertex after vertex, without gaps.
  std::vector<std::vector<unsigned char>> attributes;
};

// Memory of the decoder for a triangle and for a vertex: corners, their opposites, the order in
// which they are visited, and the vertices' tables. Rounded up from Draco 1.5.
inline constexpr uint64_t kDracoBytesPerTriangle = 96, kDracoBytesPerVertex = 64;

// Errors: kInvalidArgument with what is wrong; kResourceExhausted where a limit is.
absl::StatusOr<DracoMesh> DecodeDracoMesh(std::string_view bytes,
                                          const std::vector<DracoAttribute>& wanted,
                                          const DracoLimits& limits);

}  // namespace sheaf::gltf
