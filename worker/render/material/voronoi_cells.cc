// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/material/voronoi_cells.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "common/math/elementary.h"
#include "common/math/lattice_noise.h"

namespace sheaf::render {
namespace {

// Between points this near, an edge has no direction. The square of a distance.
constexpr double kSamePoint = 1e-4;

Vec3d TripleOf(std::array<float, 3> c) {
  return {static_cast<double>(c[0]), static_cast<double>(c[1]), static_cast<double>(c[2])};
}

class Cells {
 public:
  Cells(const VoronoiOptions& options, Vec3d p)
      : options_(options),
        below_{std::floor(p.x), std::floor(p.y), options.is_plane ? 0 : std::floor(p.z)},
        inside_(p - below_) {
    if (options.is_plane) inside_.z = 0;
  }

  // Calls visit(offset of the cell) for the cells up to `reach` away.
  template <typename Visit>
  void ForEach(int reach, const Visit& visit) const {
    const int depth = options_.is_plane ? 0 : reach;
    for (int k = -depth; k <= depth; ++k) {
      for (int j = -reach; j <= reach; ++j) {
        for (int i = -reach; i <= reach; ++i) visit(Vec3d{double(i), double(j), double(k)});
      }
    }
  }
  Vec3d RandomOf(Vec3d offset) const {
    const Vec3f at = ToFloat(below_ + offset);
    return TripleOf(options_.is_plane ? RandomTripleOf(at.x, at.y)
                                      : RandomTripleOf(at.x, at.y, at.z));
  }
  // The cell's point, from the looked-up place.
  Vec3d PointFrom(Vec3d offset) const {
    Vec3d point = offset + options_.randomness * RandomOf(offset);
    if (options_.is_plane) point.z = 0;
    return point - inside_;
  }
  double Distance(Vec3d v) const {
    const Vec3d d{std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)};
    switch (options_.metric) {
      case VoronoiMetric::kEuclidean:
        return Length(d);
      case VoronoiMetric::kManhattan:
        return d.x + d.y + d.z;
      case VoronoiMetric::kChebychev:
        return std::fmax(d.x, std::fmax(d.y, d.z));
      case VoronoiMetric::kMinkowski:
        return Pow(
            Pow(d.x, options_.exponent) + Pow(d.y, options_.exponent) + Pow(d.z, options_.exponent),
            1 / options_.exponent);
    }
    return 0;
  }

 private:
  const VoronoiOptions& options_;
  Vec3d below_, inside_;
};

VoronoiCell Nearest(const Cells& cells, bool second) {
  constexpr double kFar = std::numeric_limits<double>::max();
  double first_distance = kFar, second_distance = kFar;
  Vec3d first_offset{}, second_offset{};
  cells.ForEach(1, [&](Vec3d offset) {
    const double distance = cells.Distance(cells.PointFrom(offset));
    if (distance < first_distance) {
      second_distance = first_distance;
      second_offset = first_offset;
      first_distance = distance;
      first_offset = offset;
    } else if (distance < second_distance) {
      second_distance = distance;
      second_offset = offset;
    }
  });
  return second ? VoronoiCell{second_distance, cells.RandomOf(second_offset)}
                : VoronoiCell{first_distance, cells.RandomOf(first_offset)};
}

VoronoiCell Smooth(const Cells& cells, double smoothness) {
  VoronoiCell sum;
  bool is_first = true;
  cells.ForEach(2, [&](Vec3d offset) {
    const double distance = cells.Distance(cells.PointFrom(offset));
    const double t =
        is_first ? 1 : std::clamp(0.5 + 0.5 * (sum.distance - distance) / smoothness, 0.0, 1.0);
    is_first = false;
    const double h = t * t * (3 - 2 * t);
    const double correction = smoothness * h * (1 - h);
    sum.distance = (1 - h) * sum.distance + h * distance - correction;
    const double of_color = correction / (1 + 3 * smoothness);
    sum.color =
        (1 - h) * sum.color + h * cells.RandomOf(offset) - Vec3d{of_color, of_color, of_color};
  });
  return sum;
}

double DistanceToEdge(const Cells& cells) {
  Vec3d nearest{};
  double least = std::numeric_limits<double>::max();
  cells.ForEach(1, [&](Vec3d offset) {
    const Vec3d point = cells.PointFrom(offset);
    if (const double square = LengthSquared(point); square < least) {
      least = square;
      nearest = point;
    }
  });
  double distance = std::numeric_limits<double>::max();
  cells.ForEach(1, [&](Vec3d offset) {
    const Vec3d point = cells.PointFrom(offset), across = point - nearest;
    const double square = LengthSquared(across);
    if (square <= kSamePoint) return;
    distance = std::fmin(distance, Dot(0.5 * (nearest + point), across / std::sqrt(square)));
  });
  return distance;
}

}  // namespace

VoronoiCell VoronoiCellAt(const VoronoiOptions& options, Vec3d p) {
  const Cells cells(options, p);
  switch (options.feature) {
    case VoronoiFeature::kF1:
      return Nearest(cells, false);
    case VoronoiFeature::kF2:
      return Nearest(cells, true);
    case VoronoiFeature::kSmoothF1:
      if (options.smoothness <= 0) return Nearest(cells, false);
      return Smooth(cells, options.smoothness);
    case VoronoiFeature::kDistanceToEdge:
      return {DistanceToEdge(cells), {}};
  }
  return {};
}

}  // namespace sheaf::render
