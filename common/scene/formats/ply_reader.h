// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Meshes from PLY files: ASCII and binary of both byte orders, gzipped or not. Polygons are split
// into triangle fans; elements and properties that a mesh does not need are skipped. Source: G.
// Turk, The PLY Polygon File Format, 1994.
#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "common/scene/scene_description.h"
#include "common/scene/scene_reader_limits.h"

namespace sheaf {

// Reads x y z, nx ny nz, (u v | s t | texture_u texture_v | texture_s texture_t) and vertex_indices
// (or vertex_index). Memory is bounded by the actual size of the
// file, whatever its header claims, and by the limits.
// Errors: kInvalidArgument for values that are malformed, not finite or out of range (with the
// vertex or face number from 0, or the line), kDataLoss for a truncated file, kResourceExhausted
// beyond the limits.
struct PlyMesh {
  TriangleMesh mesh;  // Vertices minus `origin`; without `file`.
  Vec3d origin;       // 0, unless the file has coordinates that float would lose (VertexRounding).
};
// origin: the one to use; nullopt if the vertices decide.
absl::StatusOr<PlyMesh> ReadPly(const std::string& path, const SceneReaderLimits& limits,
                                std::optional<Vec3d> origin = std::nullopt);

}  // namespace sheaf
