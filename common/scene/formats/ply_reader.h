// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Meshes from PLY files: ASCII and binary of both byte orders, gzipped or not. Polygons are cut
// into fans of triangles; elements and properties that a mesh does not need are passed over.
// Source: G. Turk, The PLY Polygon File Format, 1994.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "common/scene/scene_description.h"
#include "common/scene/scene_reader_limits.h"

namespace sheaf {

// Reads x y z, nx ny nz, (u v | s t | texture_u texture_v | texture_s texture_t) and
// vertex_indices (or vertex_index). TriangleMesh::file stays empty.
// Memory is bounded by what the file really holds, whatever its header claims, and by the limits.
// Errors: kInvalidArgument for what is malformed, not finite or out of range (with vertex or face
// number from 0, or line), kDataLoss for a truncated file, kResourceExhausted beyond the limits.
absl::StatusOr<TriangleMesh> ReadPly(const std::string& path, const SceneReaderLimits& limits);

}  // namespace sheaf
