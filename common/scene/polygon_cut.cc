// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/polygon_cut.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/base/check.h"

namespace sheaf {
namespace {

// A sum of doubles without any rounding, as doubles that do not overlap, the smallest first.
class ExactSum {
 public:
  void Add(double x) {
    size_t kept = 0;
    for (const double part : parts_) {
      const double sum = x + part;
      const double part_virtual = sum - x;
      const double rounding = (x - (sum - part_virtual)) + (part - part_virtual);
      if (rounding != 0) parts_[kept++] = rounding;
      x = sum;
    }
    parts_.resize(kept);
    if (x != 0) parts_.push_back(x);
  }
  int Sign() const { return parts_.empty() ? 0 : parts_.back() > 0 ? 1 : -1; }

 private:
  std::vector<double> parts_;
};

// The product of two floats is exact in double.
double Product(float a, float b) { return static_cast<double>(a) * static_cast<double>(b); }

// The sign of the area that the points enclose.
int Direction(const std::vector<Vec2f>& points) {
  ExactSum twice_area;
  for (size_t i = 0; i < points.size(); ++i) {
    const Vec2f p = points[i], q = points[(i + 1) % points.size()];
    twice_area.Add(Product(p.x, q.y));
    twice_area.Add(-Product(p.y, q.x));
  }
  return twice_area.Sign();
}

void WriteFan(std::span<const uint32_t> corners, uint32_t* triangles) {
  for (size_t i = 2; i < corners.size(); ++i) {
    *triangles++ = corners[0];
    *triangles++ = corners[i - 1];
    *triangles++ = corners[i];
  }
}

}  // namespace

int Orientation(Vec2f a, Vec2f b, Vec2f c) {
  const double left = (static_cast<double>(a.x) - static_cast<double>(c.x)) *
                      (static_cast<double>(b.y) - static_cast<double>(c.y));
  const double right = (static_cast<double>(a.y) - static_cast<double>(c.y)) *
                       (static_cast<double>(b.x) - static_cast<double>(c.x));
  constexpr double kEpsilon = 0x1p-53;
  const double determinant = left - right;
  const double bound = (3 + 16 * kEpsilon) * kEpsilon * (std::fabs(left) + std::fabs(right));
  if (std::fabs(determinant) > bound) return determinant > 0 ? 1 : -1;
  ExactSum exact;
  exact.Add(Product(a.x, b.y));
  exact.Add(-Product(a.x, c.y));
  exact.Add(-Product(c.x, b.y));
  exact.Add(-Product(a.y, b.x));
  exact.Add(Product(a.y, c.x));
  exact.Add(Product(c.y, b.x));
  return exact.Sign();
}

// Leaves out the axis along which the polygon is least extended. False if the polygon has no area.
bool PolygonCutter::Project(const std::vector<Vec3f>& positions,
                            std::span<const uint32_t> corners) {
  const Vec3d origin = ToDouble(positions[corners[0]]);
  Vec3d normal{};
  for (size_t i = 2; i < corners.size(); ++i) {
    normal += Cross(ToDouble(positions[corners[i - 1]]) - origin,
                    ToDouble(positions[corners[i]]) - origin);
  }
  const Vec3d size{std::fabs(normal.x), std::fabs(normal.y), std::fabs(normal.z)};
  const size_t axis = size.x > size.y && size.x > size.z ? 0 : size.y > size.z ? 1 : 2;
  if (!(size[axis] > 0)) return false;
  points_.clear();
  for (const uint32_t corner : corners) {
    const Vec3f& p = positions[corner];
    points_.push_back({p[(axis + 1) % 3], p[(axis + 2) % 3]});
  }
  return true;
}

// In a polygon whose edges do not cross, triangles of one direction cannot overlap or leave it:
// each point is within as many of them as the polygon winds around it.
bool PolygonCutter::IsCoveredByFan() const {
  bool turns_left = false, turns_right = false;
  for (size_t i = 2; i < points_.size(); ++i) {
    const int turn = Orientation(points_[0], points_[i - 1], points_[i]);
    turns_left = turns_left || turn > 0;
    turns_right = turns_right || turn < 0;
  }
  return !(turns_left && turns_right);
}

int PolygonCutter::TurnAt(uint32_t corner) const {
  return Orientation(points_[previous_[corner]], points_[corner], points_[next_[corner]]);
}

// Other corners at the same place as one of the ear's do not prevent it: they join holes to the
// outline.
bool PolygonCutter::IsEar(uint32_t corner) const {
  if (TurnAt(corner) <= 0) return false;
  const Vec2f a = points_[previous_[corner]], b = points_[corner], c = points_[next_[corner]];
  const auto [x0, x1] = std::minmax({a.x, b.x, c.x});
  const auto [y0, y1] = std::minmax({a.y, b.y, c.y});
  for (uint32_t i = next_[next_[corner]]; i != previous_[corner]; i = next_[i]) {
    const Vec2f p = points_[i];
    if (p.x < x0 || p.x > x1 || p.y < y0 || p.y > y1 || p == a || p == b || p == c) continue;
    if (Orientation(a, b, p) >= 0 && Orientation(b, c, p) >= 0 && Orientation(c, a, p) >= 0) {
      return false;
    }
  }
  return true;
}

// The next ear of the `left` corners, or a corner between collinear ones where there is no ear;
// corners.size() if there is neither.
uint32_t PolygonCutter::FindEar(uint32_t from, size_t left) {
  for (const bool is_first : {true, false}) {
    uint32_t corner = from;
    for (size_t i = 0; i < left; ++i, corner = next_[corner]) {
      // Only the neighbors of an ear change by its removal, if no two corners coincide.
      if (!is_first) is_ear_[corner] = IsEar(corner) ? 1 : 0;
      if (is_ear_[corner] != 0) return corner;
    }
  }
  uint32_t corner = from;
  for (size_t i = 0; i < left; ++i, corner = next_[corner]) {
    if (TurnAt(corner) == 0) return corner;
  }
  return static_cast<uint32_t>(points_.size());
}

bool PolygonCutter::ClipEars(std::span<const uint32_t> corners, uint32_t* triangles) {
  const auto count = static_cast<uint32_t>(points_.size());
  const int direction = Direction(points_);
  if (direction == 0) return false;
  if (direction < 0) {
    for (Vec2f& p : points_) std::swap(p.x, p.y);  // The mirror image.
  }
  previous_.resize(count);
  next_.resize(count);
  is_ear_.resize(count);
  for (uint32_t i = 0; i < count; ++i) {
    previous_[i] = (i + count - 1) % count;
    next_[i] = (i + 1) % count;
  }
  for (uint32_t i = 0; i < count; ++i) is_ear_[i] = IsEar(i) ? 1 : 0;
  uint32_t from = 0;
  for (size_t left = count; left > 3; --left) {
    const uint32_t ear = FindEar(from, left);
    if (ear == count) return false;
    const uint32_t before = previous_[ear], after = next_[ear];
    for (const uint32_t corner : {before, ear, after}) *triangles++ = corners[corner];
    next_[before] = after;
    previous_[after] = before;
    is_ear_[before] = IsEar(before) ? 1 : 0;
    is_ear_[after] = IsEar(after) ? 1 : 0;
    from = after;
  }
  if (TurnAt(from) < 0) return false;
  for (const uint32_t corner : {previous_[from], from, next_[from]}) *triangles++ = corners[corner];
  return true;
}

PolygonCutter::Result PolygonCutter::Cut(const std::vector<Vec3f>& positions,
                                         std::span<const uint32_t> corners, uint32_t* triangles) {
  SHEAF_CHECK(corners.size() >= 3);
  const bool has_area = Project(positions, corners);
  if (has_area && !IsCoveredByFan()) {
    if (corners.size() > kCornersMax) {
      WriteFan(corners, triangles);
      return Result::kTooMany;
    }
    if (ClipEars(corners, triangles)) return Result::kCut;
    WriteFan(corners, triangles);
    return Result::kCrosses;
  }
  WriteFan(corners, triangles);
  if (has_area) return Result::kCut;
  // Areas of opposite directions cancel in a polygon that crosses itself.
  const Vec3d origin = ToDouble(positions[corners[0]]);
  for (size_t i = 2; i < corners.size(); ++i) {
    const Vec3d area = Cross(ToDouble(positions[corners[i - 1]]) - origin,
                             ToDouble(positions[corners[i]]) - origin);
    if (LengthSquared(area) > 0) return Result::kCrosses;
  }
  return Result::kCut;
}

}  // namespace sheaf
