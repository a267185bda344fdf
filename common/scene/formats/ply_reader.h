// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Meshes from PLY files: ASCII and binary of both byte orders, gzipped or not. Polygons are cut
// into triangles (polygon_cut.h); elements and properties that have no effect are listed. Source:
// G. Turk, The PLY Polygon File Format, 1994.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/scene/scene_description.h"
#include "common/scene/scene_reader_limits.h"

namespace sheaf {

// Something in a file that has no effect on the mesh.
struct PlySkipped {
  uint64_t line = 0;  // The line of the header; 0: none.
  uint64_t count = 0;
  // The sentence is before, count, after: "the element "edge" with ", 36, " rows is left out".
  std::string before, after;
  bool is_warning = false;  // Nothing, or something wrong, is shown.
};

// Reads x y z, nx ny nz, (u v | s t | texture_u texture_v | texture_s texture_t) and vertex_indices
// (or vertex_index) of faces and of tristrips, whose strips -1 separates. Memory is bounded by the
// actual size of the file, whatever its header claims, and by the limits. Errors: kInvalidArgument
// for values that are malformed, not finite or out of range (with the vertex or face number from 0,
// or the line), kDataLoss for a truncated file, kResourceExhausted beyond the limits.
struct PlyMesh {
  TriangleMesh mesh;  // Vertices minus `origin`; without `file`.
  Vec3d origin;       // 0, unless the file has coordinates that float would lose (VertexRounding).
  // The indices with every polygon as a fan, which the same faces with other vertices share. Empty:
  // as those of the mesh.
  std::vector<uint32_t> fans;
  std::vector<PlySkipped> skipped;

  const std::vector<uint32_t>& FanIndices() const { return fans.empty() ? mesh.indices : fans; }
};
// origin: the one to use; nullopt if the vertices decide. colors: also reads red, green and blue of
// vertices, floats in linear sRGB, and alpha; kInvalidArgument if there are none.
enum class PlyColors : uint8_t { kSkip, kRead };
absl::StatusOr<PlyMesh> ReadPly(const std::string& path, const SceneReaderLimits& limits,
                                std::optional<Vec3d> origin = std::nullopt,
                                PlyColors colors = PlyColors::kSkip);

}  // namespace sheaf
