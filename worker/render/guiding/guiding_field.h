// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GuidingField: a learned estimate of the light that arrives in each region of the scene, by
// direction. A binary tree over space, whose leaves (regions) each have a quadtree over the sphere
// (equal_area_map.h). The tree tells surfaces apart by the side that they face, before it halves
// space: both sides of a thin wall, and the walls of a corner, learn their own directions. Paths
// sample directions from it beside the BSDF. The field decides only how noisy an image is, never
// its mean.
//
// A field is a pure function of the sums that it was refined from (guiding_statistics.h). These are
// integers: the same values give the same field, to the bit, in whatever order and on however many
// threads they were added. Scaling the scene's lengths or its light by a power of two changes no
// decision.
//
// Sources: Mueller, Gross and Novak 2017, "Practical Path Guiding for Efficient Light-Transport
// Simulation"; Mueller 2019, "Practical Path Guiding in Production".
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "common/math/vec.h"
#include "worker/render/geometry/bounds.h"
#include "worker/render/guiding/guiding_point.h"

namespace sheaf::render {

// Limits; what would exceed them is not split further.
inline constexpr uint32_t kGuidingRegionsMax = 1u << 13;
inline constexpr uint32_t kGuidingQuadsMax = 1u << 20;  // In all regions together.
inline constexpr int kGuidingQuadDepthMax = 10;
inline constexpr int kGuidingSpaceDepthMax = 48;  // The tree's depth, sides included.

// The part of each region's samples that is spread evenly over the sphere, so that no direction has
// a density of 0: small against what is learned, large enough to see light that is new.
inline constexpr double kGuidingUniformShare = 0x1p-6;
// A region that has learned nothing counts light in 4^3 equal quads.
inline constexpr int kGuidingStartDepth = 3;
// A node has four quads. More than what quads of a hundredth of the light need at each depth.
inline constexpr uint32_t kGuidingNodesInRegionMax = 1u << 10;

// Bytes of an encoded field: its head, its box, a byte for each node of the tree over space, a
// double and a float for each region, and 17 bytes for each four quads.
inline constexpr size_t kGuidingDirectionsBytesMax = 8 + 48 + size_t{2} * kGuidingRegionsMax +
                                                     size_t{12} * kGuidingRegionsMax +
                                                     size_t{17} * (kGuidingQuadsMax / 4);

// The probability with which paths take a direction from a region, not from scattering, is at least
// and at most so much. The rest is a defense: a field that is wrong at a vertex costs at most a
// factor 1 / (1 - kGuidedShareMax) in variance.
inline constexpr float kGuidedShareMin = 0.1f, kGuidedShareMax = 0.9f;
// Where a region has not learned better.
inline constexpr float kGuidedShareStart = 0.5f;

// The directions of one region. Thread-safe.
class GuidingRegion {
 public:
  // A unit direction with density Pdf. u: in [0, 1)^2; keeps its stratification.
  Vec3f Sample(Vec2f u) const;
  // Per solid angle; finite. Greater than 0 for each direction that Sample returns.
  float Pdf(Vec3f w) const;
  // The light that vertices in the region scatter along their paths, as radiance: the learned mean,
  // without what light samples find there. 0: nothing is known.
  double ScatteredLight() const { return scattered_light_; }
  // The probability with which paths take a direction from the region.
  float share() const { return share_; }

 private:
  friend class GuidingField;
  friend class GuidingFieldReader;
  friend class GuidingRefinement;
  friend class GuidingStatistics;
  friend class LightRegions;

  // A square of the map in four quads, numbered x + 2 y.
  struct Node {
    std::array<float, 4>
        fraction{};  // Fractions of the square's samples; greater than 0, their sum is 1.
    std::array<uint16_t, 4> child{};  // Index of the node that divides the quad; 0: none does.
  };

  // Has learned nothing.
  GuidingRegion();
  // The undivided quad that contains a point of the map.
  struct Quad {
    uint32_t index = 0;  // 4 times its node plus its number there.
    int depth = 0;       // Its side is 2^-depth.
  };
  Quad QuadOf(Vec2f st) const;

  std::vector<Node> nodes_;  // The root, then the others by depth: a child comes after its parent.
  double scattered_light_ = 0;  // 0: the region has learned nothing.
  float share_ = kGuidedShareStart;
};

class GuidingField {
 public:
  // One region that fills the box and has learned nothing. An empty box stands for the origin.
  explicit GuidingField(const Bounds& box);
  // The region that contains the point (or is next to it, for points outside of the box); null
  // where it has learned nothing. A coordinate that is NaN counts as the box's lower one.
  const GuidingRegion* RegionAt(const GuidingPoint& at) const;
  // The same in two steps: the region's index, below region_count(), and what it has learned.
  uint32_t RegionIndexAt(const GuidingPoint& at) const { return PlaceOf(at).region; }
  const GuidingRegion* RegionOrNull(uint32_t index) const {
    const GuidingRegion& region = regions_[index];
    return region.ScatteredLight() > 0 ? &region : nullptr;
  }
  size_t region_count() const { return regions_.size(); }
  uint64_t memory_bytes() const;

  // The field as bytes, the same for equal fields on every machine. At most
  // kGuidingDirectionsBytesMax.
  std::string Encode() const;
  // Errors: kDataLoss with the reason, for bytes that Encode did not make; never undefined
  // behavior, whatever the bytes. Bytes that are those of another field are taken for it: whoever
  // stores fields names them by their digest.
  static absl::StatusOr<GuidingField> Decode(std::string_view bytes);

 private:
  friend class GuidingFieldReader;
  friend class GuidingRefinement;
  friend class GuidingStatistics;
  friend class LightRegions;

  // Halvings beyond the deepest region that positions are counted by (guiding_statistics.h).
  static constexpr int kHalvingsCounted = 6;
  static constexpr int kHalvings = kGuidingSpaceDepthMax + kHalvingsCounted;
  static constexpr int kCellBits = 48;  // The box has 2^48 cells along each axis.
  // The side that a surface faces is the place along a fourth axis, of eight cells.
  static constexpr size_t kSideAxis = 3;
  static constexpr int kSideBits = 3;
  static constexpr uint32_t kRegionBit = 1u << 31;

  // A bit of a cell's position: which half of a node contains it.
  struct Halving {
    uint8_t axis = 0, bit = 0;
  };
  struct Place {
    uint32_t region = 0;
    int depth = 0;
    std::array<uint64_t, 4> cell{};
  };

  // The box alone, without regions: the caller builds the tree from its root, space_[0].
  // Requires: finite, lower <= upper.
  GuidingField(Vec3d lower, Vec3d upper);
  // Gives a node two children, and returns the first one's index; the second one follows.
  uint32_t Halve(uint32_t node);
  void SetRegion(uint32_t node, GuidingRegion region);

  Place PlaceOf(const GuidingPoint& at) const;
  // Sets the region and the depth by the cell.
  void FindRegion(Place* place) const;
  // A region at that depth has 2^n cells along the axis of space.
  int SizeBits(int depth, size_t axis) const;
  uint32_t HalfOf(const Place& place, int depth) const {
    const Halving halving = halvings_[static_cast<size_t>(depth)];
    return static_cast<uint32_t>(place.cell[halving.axis] >> halving.bit) & 1;
  }

  Vec3d lower_, upper_;
  Vec3d cells_per_length_;
  // By depth. Sides are told apart first. All nodes of one depth have the same size; their longest
  // side is halved, x before y before z.
  std::array<Halving, kHalvings> halvings_{};
  std::vector<uint32_t> space_;  // A node's first child, or kRegionBit and a region's index.
  std::vector<GuidingRegion> regions_;
};

}  // namespace sheaf::render
