// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PlyFaces: the polygons and strips of a PLY file as triangles. Polygons are fans at first, for
// their vertices may follow later; Cut then cuts those anew that their fans do not cover
// (polygon_cut.h).
#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "common/math/vec.h"

namespace sheaf {

class PlyFaces {
 public:
  void BeginPolygon() { corner_count_ = 0; }
  void AddToPolygon(uint32_t index);
  // Every second triangle of a strip turns the other way. Source: the files of the Stanford 3D
  // Scanning Repository.
  void BeginStrip() { corner_count_ = 0; }
  void AddToStrip(uint32_t index);

  const std::vector<uint32_t>& indices() const { return indices_; }
  uint64_t SizeBytes() const;
  // crossing_count: of the polygons that have no inside, and stay fans. Requires: all indices are
  // below positions.size(). Errors: kResourceExhausted for a polygon that is too large to cut.
  absl::Status Cut(const std::vector<Vec3f>& positions, uint64_t* crossing_count);
  std::vector<uint32_t> TakeIndices() { return std::move(indices_); }
  // As PlyMesh::fans.
  std::vector<uint32_t> TakeFans() { return std::move(fans_); }

 private:
  void AddTriangle(uint32_t a, uint32_t b, uint32_t c, bool continues);

  std::vector<uint32_t> indices_;
  // By triangle: whether it continues the fan of the one before.
  std::vector<bool> continues_;
  std::vector<uint32_t> fans_;
  std::array<uint32_t, 2>
      latest_{};  // The last two corners of the strip; of a polygon, the first and the latest.
  uint64_t corner_count_ = 0;  // Corners of the polygon or strip so far.
};

}  // namespace sheaf
