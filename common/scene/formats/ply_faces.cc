// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/ply_faces.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "common/scene/polygon_cut.h"

namespace sheaf {

uint64_t PlyFaces::SizeBytes() const {
  return indices_.size() * sizeof(uint32_t) + continues_.size() / 8;
}

void PlyFaces::AddTriangle(uint32_t a, uint32_t b, uint32_t c, bool continues) {
  indices_.insert(indices_.end(), {a, b, c});
  continues_.push_back(continues);
}

void PlyFaces::AddToPolygon(uint32_t index) {
  if (corner_count_ == 0) latest_[0] = index;
  if (corner_count_ >= 2) AddTriangle(latest_[0], latest_[1], index, corner_count_ > 2);
  latest_[1] = index;
  ++corner_count_;
}

void PlyFaces::AddToStrip(uint32_t index) {
  // Strips are joined by triangles that have a vertex twice.
  const bool has_area = latest_[0] != latest_[1] && index != latest_[0] && index != latest_[1];
  if (corner_count_ >= 2 && has_area) {
    const bool is_even = corner_count_ % 2 == 0;
    AddTriangle(latest_[is_even ? 0 : 1], latest_[is_even ? 1 : 0], index, false);
  }
  latest_ = {latest_[1], index};
  ++corner_count_;
}

absl::Status PlyFaces::Cut(const std::vector<Vec3f>& positions, uint64_t* crossing_count) {
  PolygonCutter cutter;
  std::vector<uint32_t> corners, cut;
  *crossing_count = 0;
  for (size_t begin = 0, end = 0; begin < continues_.size(); begin = end) {
    for (end = begin + 1; end < continues_.size() && continues_[end]; ++end) {
    }
    if (end - begin == 1) continue;
    const auto triangles = indices_.begin() + static_cast<ptrdiff_t>(3 * begin);
    corners.assign(triangles, triangles + 2);
    for (size_t i = begin; i < end; ++i) corners.push_back(indices_[3 * i + 2]);
    cut.resize(3 * (end - begin));
    switch (cutter.Cut(positions, corners, cut.data())) {
      case PolygonCutter::Result::kCut:
        if (std::equal(cut.begin(), cut.end(), triangles)) break;
        if (fans_.empty()) fans_ = indices_;
        std::copy(cut.begin(), cut.end(), triangles);
        break;
      case PolygonCutter::Result::kCrosses:
        ++*crossing_count;
        break;
      case PolygonCutter::Result::kTooMany:
        return absl::ResourceExhaustedError(absl::StrCat(
            "a face that is not convex has ", corners.size(), " vertices, the limit is ",
            PolygonCutter::kCornersMax, " (kCornersMax); cut it into smaller ones"));
    }
  }
  return absl::OkStatus();
}

}  // namespace sheaf
