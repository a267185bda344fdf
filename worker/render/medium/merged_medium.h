// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MergedMedium: heterogeneous media that overlap, in one structure: a tree of cells over all of
// them, each with the list of the media that are not empty there and the bounds of their densities.
// A ray walks through this tree once, however many media there are. Tracking: merged_tracking.h.
//
// Space: *cell* space has the tree's voxels as its unit; it is neither turned nor sheared against
// render space.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "worker/render/geometry/bounds.h"
#include "worker/render/medium/heterogeneous_medium.h"
#include "worker/render/medium/majorant_grid.h"

namespace sheaf::render {

// Maximum number of densities that one structure merges: a ray keeps coefficients of each.
inline constexpr size_t kMergedMembersMax = 64;
// Voxels of the tree along the longest side of its box: 64 of its finest cells.
inline constexpr int32_t kMergedSideMax = 128;

class MergedMedium {
 public:
  // A density, and the part of a MediumTable's medium that it belongs to.
  struct Member {
    const HeterogeneousMedium* density = nullptr;
    // Its largest extinction at a density of 1, over color components; decides how fine cells are.
    double extinction_max = 0;
    uint16_t medium = 0, part = 0;
  };
  // A member that is not empty in a cell.
  struct Entry {
    uint32_t member = 0;
    DensityBounds bounds;
  };
  struct Segment {
    double t0 = 0, t1 = 0;
    std::span<const Entry> entries;
  };

  // box: contains the members' boxes; space: render. Requires: the densities outlive *this and do
  // not move; at most kMergedMembersMax members.
  MergedMedium(std::vector<Member> members, const Bounds& box, int thread_count);

  const std::vector<Member>& members() const { return members_; }
  // The members' own memory is not included.
  uint64_t memory_bytes() const;

  // Enumerates the segments of o + t d, t in [0, t_max], like MajorantWalk. Space: render.
  class Walk {
   public:
    Walk(const MergedMedium& merged, Vec3d o, Vec3d d, double t_max)
        : merged_(merged),
          o_(merged.ToCells(o)),
          d_(merged.per_unit_ * d),
          walk_(merged.tree_, o_, d_, 0, t_max) {}
    bool Next(Segment* segment) {
      MajorantSegment found;
      if (!walk_.Next(&found)) return false;
      *segment = {found.t0, found.t1, {}};
      if (!(found.bounds.upper > 0)) return true;
      // Cells have a margin: it does not matter which one the middle of a very short segment is in.
      const double middle = found.t0 + 0.5 * (found.t1 - found.t0);
      segment->entries = merged_.EntriesOf(merged_.tree_.CellAt(o_ + middle * d_).id);
      return true;
    }

   private:
    const MergedMedium& merged_;
    Vec3d o_, d_;
    MajorantWalk walk_;
  };

 private:
  Vec3d ToCells(Vec3d p) const { return per_unit_ * (p - origin_); }
  std::span<const Entry> EntriesOf(uint32_t cell) const {
    return std::span(entries_).subspan(first_[cell], first_[cell + 1] - first_[cell]);
  }

  std::vector<Member> members_;
  Vec3d origin_;         // The origin of cell space, in render space.
  double per_unit_ = 1;  // Voxels per unit of render space.
  MajorantGrid
      tree_;  // Bounds of the sum of the members' densities, each times its extinction_max.
  std::vector<uint32_t> first_;  // By cell: its first entry.
  std::vector<Entry> entries_;
};

}  // namespace sheaf::render
