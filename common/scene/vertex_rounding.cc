// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/vertex_rounding.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"

namespace sheaf {
namespace {

// A mesh is moved if it is this much nearer to its own middle than to the origin, and if rounding
// would take more than this part of the distance between its vertices.
constexpr double kFartherMin = 4, kRoundingMax = 0x1p-16;
// Neighbors are close if this number of floats separates them, at most. A mesh with a few of them
// is fine; one with many is not.
constexpr double kStepsApartMin = 8, kCloseShareMax = 0.05;
// A mesh that is nearer to the origin, in its own size, has room for 2^18 steps; if vertices are
// that close nevertheless, another place would not part them.
constexpr double kFarMin = 64;

struct Extent {
  Vec3d lower, upper;
  double farthest = 0;  // Largest coordinate.
  double size = 0;      // Longest side.
};
Extent ExtentOf(const std::vector<Vec3f>& positions) {
  Extent extent;
  if (positions.empty()) return extent;
  extent.lower = extent.upper = ToDouble(positions.front());
  for (const Vec3f& p : positions) {
    for (size_t i = 0; i < 3; ++i) {
      extent.lower[i] = std::min(extent.lower[i], static_cast<double>(p[i]));
      extent.upper[i] = std::max(extent.upper[i], static_cast<double>(p[i]));
    }
  }
  for (size_t i = 0; i < 3; ++i) {
    extent.farthest =
        std::max({extent.farthest, std::fabs(extent.lower[i]), std::fabs(extent.upper[i])});
    extent.size = std::max(extent.size, extent.upper[i] - extent.lower[i]);
  }
  return extent;
}

bool IsSameLinearPart(const Matrix4& a, const Matrix4& b) {
  for (size_t row = 0; row < 3; ++row) {
    for (size_t column = 0; column < 3; ++column) {
      if (a.m[row][column] != b.m[row][column]) return false;
    }
  }
  return a.m[3] == b.m[3];
}

}  // namespace

void VertexRounding::Add(Vec3f rounded, Vec3f remainder) {
  const bool is_exact = remainder == Vec3f{};
  if (remainders_.empty() && !is_exact) remainders_.resize(rounded_.size());
  rounded_.push_back(rounded);
  if (!remainders_.empty() || !is_exact) remainders_.push_back(remainder);
}

std::vector<Vec3f> VertexRounding::TakeAbout(Vec3d origin) {
  std::vector<Vec3f> result = std::move(rounded_);
  if (!(origin == Vec3d{})) {
    for (size_t i = 0; i < result.size(); ++i) {
      const Vec3d p = ToDouble(result[i]) - origin;
      result[i] = ToFloat(remainders_.empty() ? p : p + ToDouble(remainders_[i]));
    }
  }
  rounded_ = {};
  remainders_ = {};
  return result;
}

std::vector<Vec3f> VertexRounding::Take(Vec3d* origin) {
  *origin = {};
  if (!remainders_.empty()) {
    const Extent extent = ExtentOf(rounded_);
    // As if the vertices were spread over a square.
    const double spacing = extent.size / std::sqrt(static_cast<double>(rounded_.size()));
    const double step =
        extent.farthest * static_cast<double>(std::numeric_limits<float>::epsilon());
    if (extent.farthest > kFartherMin * extent.size && step > spacing * kRoundingMax) {
      // A float, so that vertices that are floats themselves stay exact.
      *origin = ToDouble(ToFloat(extent.lower * 0.5 + extent.upper * 0.5));
    }
  }
  return TakeAbout(*origin);
}

bool CanMoveOrigin(const TransformOverTime& world_from_object) {
  return IsSameLinearPart(world_from_object.start, world_from_object.end);
}

void MoveOrigin(Vec3d origin, TransformOverTime* world_from_object) {
  if (origin == Vec3d{}) return;
  const Matrix4 shift = TranslateMatrix(origin);
  world_from_object->start = world_from_object->start * shift;
  world_from_object->end = world_from_object->end * shift;
}

std::optional<std::string> WhyImprecise(const std::vector<Vec3f>& positions,
                                        const std::vector<uint32_t>& indices, size_t corners) {
  const Extent extent = ExtentOf(positions);
  if (!(extent.farthest > kFarMin * extent.size)) return std::nullopt;
  const double step = extent.farthest * static_cast<double>(std::numeric_limits<float>::epsilon());
  uint64_t close = 0, edges = 0;
  for (size_t face = 0; face + corners <= indices.size(); face += corners) {
    for (size_t k = 0; k < corners; ++k) {
      const Vec3d a = ToDouble(positions[indices[face + k]]);
      const Vec3d b = ToDouble(positions[indices[face + (k + 1) % corners]]);
      ++edges;
      if (LengthSquared(b - a) < kStepsApartMin * step * kStepsApartMin * step) ++close;
    }
  }
  if (static_cast<double>(close) <= kCloseShareMax * static_cast<double>(edges)) {
    return std::nullopt;
  }
  return absl::StrCat(close, " of ", edges, " edges join neighboring vertices that are fewer than ",
                      kStepsApartMin, " steps of 32-bit floats apart: the mesh is ", extent.size,
                      " in size and ", extent.farthest,
                      " from the origin of its coordinates, where a step is ", step,
                      "; export it about its own middle and place it by a transformation, or with "
                      "coordinates of double precision (PLY: property double)");
}

}  // namespace sheaf
