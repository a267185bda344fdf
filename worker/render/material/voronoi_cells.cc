// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/material/voronoi_cells.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>

#include "common/math/elementary.h"
#include "common/math/lattice_noise.h"

namespace sheaf::render {
namespace {

// Between points this near, an edge has no direction. The square of a distance.
constexpr double kSamePoint = 1e-4;

Vec3d TripleOf(std::array<float, 3> c) {
  return {static_cast<double>(c[0]), static_cast<double>(c[1]), static_cast<double>(c[2])};
}

template <size_t N>
using Point = std::array<double, N>;

template <size_t N>
double LengthSquaredOf(const Point<N>& v) {
  double sum = 0;
  for (size_t i = 0; i < N; ++i) sum += v[i] * v[i];
  return sum;
}

template <size_t N>
double DistanceTo(const VoronoiOptions& options, Point<N> d) {
  for (double& x : d) x = std::fabs(x);
  if (options.metric == VoronoiMetric::kEuclidean || N == 1) return std::sqrt(LengthSquaredOf(d));
  double sum = 0;
  for (const double x : d) {
    if (options.metric == VoronoiMetric::kManhattan) sum += x;
    if (options.metric == VoronoiMetric::kChebychev) sum = std::fmax(sum, x);
    if (options.metric == VoronoiMetric::kMinkowski) sum += Pow(x, options.exponent);
  }
  return options.metric == VoronoiMetric::kMinkowski ? Pow(sum, 1 / options.exponent) : sum;
}

template <size_t N>
class Cells {
 public:
  Cells(const VoronoiOptions& options, const Point<N>& p) : options_(options) {
    for (size_t i = 0; i < N; ++i) {
      below_[i] = std::floor(p[i]);
      inside_[i] = p[i] - below_[i];
    }
  }

  // Calls visit(offset of the cell) for the cells up to `reach` away; the first axis is innermost.
  template <typename Visit>
  void ForEach(int reach, const Visit& visit) const {
    Point<N> offset;
    offset.fill(-reach);
    for (;;) {
      visit(offset);
      size_t axis = 0;
      while (axis < N && offset[axis] == reach) offset[axis++] = -reach;
      if (axis == N) return;
      ++offset[axis];
    }
  }
  Vec3d ColorOf(const Point<N>& offset) const {
    const std::array<float, N> at = At(offset);
    return TripleOf(std::apply([](auto... x) { return RandomTripleOf(x...); }, at));
  }
  // The cell's point, from the looked-up place.
  Point<N> PointFrom(const Point<N>& offset) const {
    const std::array<float, N> at = At(offset);
    Point<N> point;
    const auto set = [&](const auto& random) {
      for (size_t i = 0; i < N; ++i) {
        point[i] = offset[i] + options_.randomness * static_cast<double>(random[i]) - inside_[i];
      }
    };
    if constexpr (N == 4) {
      set(RandomQuadrupleOf(at[0], at[1], at[2], at[3]));
    } else {
      set(std::apply([](auto... x) { return RandomTripleOf(x...); }, at));
    }
    return point;
  }
  double Distance(const Point<N>& v) const { return DistanceTo(options_, v); }

 private:
  std::array<float, N> At(const Point<N>& offset) const {
    std::array<float, N> at;
    for (size_t i = 0; i < N; ++i) at[i] = static_cast<float>(below_[i] + offset[i]);
    return at;
  }

  const VoronoiOptions& options_;
  Point<N> below_, inside_;
};

template <size_t N>
VoronoiCell Nearest(const Cells<N>& cells, bool second) {
  constexpr double kFar = std::numeric_limits<double>::max();
  double first_distance = kFar, second_distance = kFar;
  Point<N> first_offset{}, second_offset{};
  cells.ForEach(1, [&](const Point<N>& offset) {
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
  return second ? VoronoiCell{second_distance, cells.ColorOf(second_offset)}
                : VoronoiCell{first_distance, cells.ColorOf(first_offset)};
}

template <size_t N>
VoronoiCell Smooth(const Cells<N>& cells, double smoothness) {
  VoronoiCell sum;
  bool is_first = true;
  cells.ForEach(2, [&](const Point<N>& offset) {
    const double distance = cells.Distance(cells.PointFrom(offset));
    const double t =
        is_first ? 1 : std::clamp(0.5 + 0.5 * (sum.distance - distance) / smoothness, 0.0, 1.0);
    is_first = false;
    const double h = t * t * (3 - 2 * t);
    const double correction = smoothness * h * (1 - h);
    sum.distance = (1 - h) * sum.distance + h * distance - correction;
    const double of_color = correction / (1 + 3 * smoothness);
    sum.color =
        (1 - h) * sum.color + h * cells.ColorOf(offset) - Vec3d{of_color, of_color, of_color};
  });
  return sum;
}

// On a line the neighbors of the cell's own point are those of the cells beside it.
double DistanceToEdge(const Cells<1>& cells) {
  const double own = cells.PointFrom({0})[0];
  return std::fmin(std::fabs(own + cells.PointFrom({-1})[0]),
                   std::fabs(own + cells.PointFrom({1})[0])) /
         2;
}

template <size_t N>
double DistanceToEdge(const Cells<N>& cells) {
  Point<N> nearest{};
  double least = std::numeric_limits<double>::max();
  cells.ForEach(1, [&](const Point<N>& offset) {
    const Point<N> point = cells.PointFrom(offset);
    if (const double square = LengthSquaredOf(point); square < least) {
      least = square;
      nearest = point;
    }
  });
  double distance = std::numeric_limits<double>::max();
  cells.ForEach(1, [&](const Point<N>& offset) {
    const Point<N> point = cells.PointFrom(offset);
    Point<N> across;
    for (size_t i = 0; i < N; ++i) across[i] = point[i] - nearest[i];
    const double square = LengthSquaredOf(across);
    if (square <= kSamePoint) return;
    double along = 0;
    for (size_t i = 0; i < N; ++i) {
      along += 0.5 * (nearest[i] + point[i]) * (across[i] / std::sqrt(square));
    }
    distance = std::fmin(distance, along);
  });
  return distance;
}

template <size_t N>
VoronoiCell CellAt(const VoronoiOptions& options, const Point<N>& p) {
  const Cells<N> cells(options, p);
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

}  // namespace

VoronoiCell VoronoiCellAt(const VoronoiOptions& options, const VoronoiPlace& place) {
  const Vec3d p = place.p;
  switch (options.dimensions) {
    case 1:
      return CellAt<1>(options, {place.w});
    case 2:
      return CellAt<2>(options, {p.x, p.y});
    case 4:
      return CellAt<4>(options, {p.x, p.y, p.z, place.w});
    default:
      return CellAt<3>(options, {p.x, p.y, p.z});
  }
}

double VoronoiReach(const VoronoiOptions& options, double side) {
  switch (options.dimensions) {
    case 1:
      return DistanceTo<1>(options, {side});
    case 2:
      return DistanceTo<2>(options, {side, side});
    case 4:
      return DistanceTo<4>(options, {side, side, side, side});
    default:
      return DistanceTo<3>(options, {side, side, side});
  }
}

}  // namespace sheaf::render
