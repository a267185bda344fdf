// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/guiding/guiding_field.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "common/base/vector_bytes.h"
#include "common/math/elementary.h"
#include "worker/render/sampling/equal_area_map.h"

namespace sheaf::render {
namespace {

constexpr float kUniformPdf = static_cast<float>(1 / (4 * kPi));
constexpr double kBelowOne = 1 - 0x1p-24;

// Chooses between two parts by their probabilities and stretches u over the chosen one, as McCool
// and Harwood 1997, "Probability Trees". Requires: a, b > 0.
bool ChooseSecond(double a, double b, double* u) {
  const double v = *u * (a + b);
  const bool is_second = v >= a;
  *u = std::min(kBelowOne, (v - (is_second ? a : 0.0)) / (is_second ? b : a));
  return is_second;
}

// The cell of a coordinate of the map, of 2^kGuidingQuadDepthMax; 0 for NaN.
uint32_t MapCell(float s) {
  constexpr auto kCells = static_cast<float>(1 << kGuidingQuadDepthMax);
  return s > 0 ? static_cast<uint32_t>(std::min(s * kCells, kCells - 1)) : 0;
}
struct MapPosition {
  uint32_t x, y;
};
MapPosition MapPositionOf(Vec2f st) { return {MapCell(st.x), MapCell(st.y)}; }
size_t QuadAt(MapPosition p, int depth) {
  const int bit = kGuidingQuadDepthMax - 1 - depth;
  return (p.x >> bit & 1) | (p.y >> bit & 1) << 1;
}

// The axis that the normal is next to, and its sign; 0 without a normal.
uint64_t SideOf(Vec3f n) {
  const Vec3f a{std::fabs(n.x), std::fabs(n.y), std::fabs(n.z)};
  size_t axis = a.y > a.x ? 1 : 0;
  if (a.z > a[axis]) axis = 2;
  if (!(a[axis] > 0)) return 0;
  return 1 + 2 * axis + (n[axis] < 0 ? 1 : 0);
}

// The double next to v that a point can have; a bound that is not finite has no cells.
double FiniteBound(double v) {
  constexpr double kMax = std::numeric_limits<float>::max();
  return v > -kMax ? std::min(v, kMax) : -kMax;
}
Vec3d FiniteBounds(Vec3d v) { return {FiniteBound(v.x), FiniteBound(v.y), FiniteBound(v.z)}; }

}  // namespace

GuidingRegion::GuidingRegion() {
  constexpr size_t kInner = ((size_t{1} << 2 * (kGuidingStartDepth - 1)) - 1) / 3;
  constexpr size_t kNodes = ((size_t{1} << 2 * kGuidingStartDepth) - 1) / 3;
  nodes_.resize(kNodes);
  for (size_t i = 0; i < kNodes; ++i) {
    for (size_t q = 0; q < 4; ++q) {
      nodes_[i].fraction[q] = 0.25f;
      nodes_[i].child[q] = static_cast<uint16_t>(i < kInner ? 4 * i + 1 + q : 0);
    }
  }
}

Vec3f GuidingRegion::Sample(Vec2f u) const {
  double x = u.x, y = u.y;
  double left = 0, top = 0, side = 1;
  uint32_t index = 0;
  do {
    const Node& node = nodes_[index];
    const double f[4] = {node.fraction[0], node.fraction[1], node.fraction[2], node.fraction[3]};
    const size_t row = ChooseSecond(f[0] + f[1], f[2] + f[3], &y) ? 2 : 0;
    const size_t column = ChooseSecond(f[row], f[row + 1], &x) ? 1 : 0;
    side *= 0.5;
    left += column != 0 ? side : 0;
    top += row != 0 ? side : 0;
    index = node.child[row + column];
  } while (index != 0);
  return ToFloat(EqualAreaSquareToSphere({left + side * x, top + side * y}));
}

float GuidingRegion::Pdf(Vec3f w) const {
  const MapPosition p = MapPositionOf(EqualAreaSphereToSquare(w));
  float pdf = kUniformPdf;
  uint32_t index = 0;
  int depth = 0;
  do {
    const Node& node = nodes_[index];
    const size_t quad = QuadAt(p, depth++);
    pdf *= 4 * node.fraction[quad];
    index = node.child[quad];
  } while (index != 0);
  return pdf;
}

GuidingRegion::Quad GuidingRegion::QuadOf(Vec2f st) const {
  const MapPosition p = MapPositionOf(st);
  uint32_t index = 0;
  for (int depth = 0;; ++depth) {
    const size_t quad = QuadAt(p, depth);
    const uint32_t child = nodes_[index].child[quad];
    if (child == 0) return {4 * index + static_cast<uint32_t>(quad), depth + 1};
    index = child;
  }
}

GuidingField::GuidingField(const Bounds& box)
    : GuidingField(box.empty() ? Vec3d{} : FiniteBounds(box.lower()),
                   box.empty() ? Vec3d{} : FiniteBounds(box.upper())) {
  SetRegion(0, GuidingRegion());
}

GuidingField::GuidingField(Vec3d lower, Vec3d upper) : lower_(lower), upper_(upper), space_{0} {
  constexpr auto kCells = static_cast<double>(uint64_t{1} << kCellBits);
  Vec3d side = upper - lower;
  for (size_t i = 0; i < 3; ++i) cells_per_length_[i] = side[i] > 0 ? kCells / side[i] : 0;
  std::array<int, 3> bit{kCellBits, kCellBits, kCellBits};
  for (int i = 0; i < kSideBits; ++i) {
    halvings_[static_cast<size_t>(i)] = {kSideAxis, static_cast<uint8_t>(kSideBits - 1 - i)};
  }
  for (Halving& halving : std::span(halvings_).subspan(kSideBits)) {
    size_t axis = side.y > side.x ? 1 : 0;
    if (side.z > side[axis]) axis = 2;
    side[axis] *= 0.5;
    // A line is halved more often than it has cells where no region is any more.
    bit[axis] = std::max(bit[axis] - 1, 0);
    halving = {static_cast<uint8_t>(axis), static_cast<uint8_t>(bit[axis])};
  }
}

uint32_t GuidingField::Halve(uint32_t node) {
  const auto first = static_cast<uint32_t>(space_.size());
  space_[node] = first;
  space_.resize(space_.size() + 2);
  return first;
}

void GuidingField::SetRegion(uint32_t node, GuidingRegion region) {
  space_[node] = kRegionBit | static_cast<uint32_t>(regions_.size());
  regions_.push_back(std::move(region));
}

GuidingField::Place GuidingField::PlaceOf(const GuidingPoint& at) const {
  constexpr auto kCellMax = static_cast<double>((uint64_t{1} << kCellBits) - 1);
  Place place;
  for (size_t i = 0; i < 3; ++i) {
    const double cell = (static_cast<double>(at.p[i]) - lower_[i]) * cells_per_length_[i];
    place.cell[i] = static_cast<uint64_t>(cell > 0 ? std::min(cell, kCellMax) : 0.0);
  }
  place.cell[kSideAxis] = SideOf(at.n);
  FindRegion(&place);
  return place;
}

void GuidingField::FindRegion(Place* place) const {
  place->depth = 0;
  uint32_t node = space_[0];
  while ((node & kRegionBit) == 0) node = space_[node + HalfOf(*place, place->depth++)];
  place->region = node & ~kRegionBit;
}

int GuidingField::SizeBits(int depth, size_t axis) const {
  int bits = kCellBits;
  for (const Halving halving : std::span(halvings_).first(static_cast<size_t>(depth))) {
    if (halving.axis == axis) bits = halving.bit;
  }
  return bits;
}

const GuidingRegion* GuidingField::RegionAt(const GuidingPoint& at) const {
  const GuidingRegion& region = regions_[PlaceOf(at).region];
  return region.scattered_light_ > 0 ? &region : nullptr;
}

uint64_t GuidingField::memory_bytes() const {
  uint64_t bytes = sizeof(*this) + VectorBytes(space_, regions_);
  for (const GuidingRegion& region : regions_) bytes += VectorBytes(region.nodes_);
  return bytes;
}

}  // namespace sheaf::render
