// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MajorantGrid: bounds of a medium's density over the cells of a tree, fine where the density
// varies enough to justify it and coarse elsewhere; and MajorantWalk, which follows a ray through
// the cells. Bounds are exact: a trilinear lookup at a point of a cell never lies outside them,
// even if rounding moves the point by up to one voxel.
//
// The tree branches by 4 on each axis. Its finest cells have 2 voxels a side. Cells are divided by
// the expected cost of a ray: steps from cell to cell against wasted lookups under a loose
// majorant. Sources: Yue et al. 2010, "Unbiased, adaptive stochastic sampling for rendering
// inhomogeneous participating media" (partition by cost); Szirmay-Kalos et al. 2011 (majorants
// along a ray).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/math/vec.h"
#include "common/volume/volume_grid.h"

namespace sheaf::render {

struct DensityBounds {
  float lower = 0, upper = 0;
  friend bool operator==(const DensityBounds&, const DensityBounds&) = default;
};

// The density that a MajorantGrid bounds, in index space. Used only while the grid is built.
// Thread safety: const methods may be called concurrently.
class DensitySource {
 public:
  virtual ~DensitySource() = default;
  // Bounding box of the medium. Requires: coordinates within +-2^25.
  virtual IndexBox Box() const = 0;
  // Bounds over all space.
  virtual DensityBounds Bounds() const = 0;
  // The value of voxels lo..hi, both included, if all are known to be equal.
  virtual std::optional<float> UniformValue(Index3 lo, Index3 hi) const = 0;
  // Bounds over the 4^3 cells of 2 voxels a side in the block of 8 at `origin`, x slowest. Each
  // cell's bounds include a margin of one voxel on all sides.
  virtual void BlockBounds(Index3 origin, std::span<DensityBounds, 64> cells) const = 0;
  // The union of these bounds, exactly, if it is known without looking at the block.
  virtual std::optional<DensityBounds> BlockUnion(Index3 /*origin*/) const { return std::nullopt; }
};

// A scalar grid times a factor. Requires: grid outlives *this, factor >= 0.
class GridDensitySource : public DensitySource {
 public:
  explicit GridDensitySource(const VolumeGrid& grid, float factor = 1)
      : grid_(grid), factor_(factor) {}
  IndexBox Box() const override { return grid_.box(); }
  DensityBounds Bounds() const override;
  std::optional<float> UniformValue(Index3 lo, Index3 hi) const override;
  void BlockBounds(Index3 origin, std::span<DensityBounds, 64> cells) const override;
  std::optional<DensityBounds> BlockUnion(Index3 origin) const override;

 private:
  const VolumeGrid& grid_;
  float factor_;
};

// One component of a grid of vectors, 0 outside the box. Requires: grid outlives *this.
class ComponentSource : public DensitySource {
 public:
  ComponentSource(const VolumeGrid& grid, size_t component, const IndexBox& box)
      : grid_(grid), component_(component), box_(box) {}
  IndexBox Box() const override { return box_; }
  DensityBounds Bounds() const override;
  std::optional<float> UniformValue(Index3 lo, Index3 hi) const override;
  void BlockBounds(Index3 origin, std::span<DensityBounds, 64> cells) const override;

 private:
  const VolumeGrid& grid_;
  size_t component_;
  IndexBox box_;
};

class MajorantGrid {
 public:
  struct Options {
    // Extinction per unit of density over the length of a voxel, which decides how fine cells are.
    double extinction_per_voxel = 1;
    int thread_count = 1;
    // Maximum number of 8^3 blocks; beyond it cells stay coarse. 0: a single cell for the whole
    // box.
    uint64_t block_count_max = uint64_t{1} << 26;
  };
  // Empty: majorant 0 everywhere.
  MajorantGrid() = default;
  static MajorantGrid Build(const DensitySource& source, const Options& options);

  const IndexBox& box() const { return box_; }
  // Over the whole box.
  DensityBounds bounds() const { return bounds_; }
  // Bounds of lookups in a region and up to one voxel around it; the density is 0 outside the box.
  DensityBounds BoundsOver(const IndexBox& region) const;
  // The density if it is the same in the whole box: the medium is homogeneous.
  std::optional<float> constant() const;
  uint64_t memory_bytes() const;
  uint64_t cell_count() const { return 64 * (nodes_.size() + bricks_.size()); }

  // A cell that is not divided: its number, below cell_count(), and its voxels.
  struct Cell {
    uint32_t id = 0;
    Index3 lo{};
    int32_t size = 0;
    DensityBounds bounds;
  };
  // The cell of the point, or of the nearest voxel of the box. Requires: the grid is not empty.
  Cell CellAt(Vec3d p) const;
  std::vector<Cell> Cells() const;

 private:
  friend class MajorantWalk;
  friend class MajorantBuilder;

  // A child is a cell (link 0), a node or, at the lowest level, a brick; the index is link - 1.
  struct Child {
    DensityBounds bounds;
    uint32_t link = 0;
  };
  using Node = std::array<Child, 64>;
  using Brick = std::array<DensityBounds, 64>;

  void AddCells(uint32_t node, Index3 origin, int32_t shift, std::vector<Cell>* cells) const;
  // Adds the bounds between voxels lo and hi, both included, of a node whose children have 2^shift
  // voxels a side.
  void Include(const Node& node, Index3 origin, int32_t shift, Index3 lo, Index3 hi,
               DensityBounds* bounds) const;

  IndexBox box_;
  Index3 cell_min_{0, 0, 0}, cell_max_{-1, -1, -1};  // Voxel range that the box overlaps.
  DensityBounds bounds_;
  Index3 origin_{0, 0, 0};
  int32_t levels_ = 0;  // Node levels; the root's children have 8 * 4^(levels - 1) voxels a side.
  std::vector<Node> nodes_;
  std::vector<Brick> bricks_;
};

// A piece of a ray, with bounds of the density on it.
struct MajorantSegment {
  double t0 = 0, t1 = 0;  // t0 < t1.
  DensityBounds bounds;
};

// Enumerates the segments of a ray in order. They partition [t_min, t_max] to the bit: the first
// begins at t_min, each begins where the previous one ends, and the last ends at t_max, which may
// be infinite. Outside the grid's box the bounds are 0. Source: Amanatides and Woo 1987, made
// hierarchical; the next cell is found in integer arithmetic.
class MajorantWalk {
 public:
  // Walks along o + t d in the grid's index space. Requires: grid outlives *this; o and d are
  // finite, and |o| < 2^40, t_min <= t_max.
  MajorantWalk(const MajorantGrid& grid, Vec3d o, Vec3d d, double t_min, double t_max);
  // Returns false after the last segment.
  bool Next(MajorantSegment* segment);

 private:
  enum class Phase { kBefore, kInside, kAfter, kDone };
  bool NextInside(MajorantSegment* segment);
  // Finds the cell that contains voxel cell_.
  DensityBounds FindCell(Index3* lo, int32_t* size) const;
  void Leave(size_t axis, Index3 lo, int32_t size);

  const MajorantGrid& grid_;
  Vec3d o_, d_, inverse_d_;
  double t_, t_box_begin_, t_box_end_, t_max_;
  Index3 cell_{};
  Phase phase_ = Phase::kBefore;
};

}  // namespace sheaf::render
