// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/majorant_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "common/base/check.h"
#include "common/base/parallel.h"

namespace sheaf::render {
namespace {

constexpr int32_t kBlock = 8;      // Voxels per side: a leaf of the volume grid.
constexpr int32_t kFine = 2;       // Voxels per side of the finest cells.
constexpr int32_t kTaskLevel = 3;  // Cells of 8 * 4^3 voxels a side are built as independent tasks.

// Relative costs of a step to the next cell and of a tentative collision, as measured by
// volume_bench.
constexpr double kStepCost = 1, kLookUpCost = 1;
// Random lines hit a cube of side L 3 / (2 L) times per unit of volume. Source: Cauchy's formula.
constexpr double kCrossingsTimesSide = 1.5;

int32_t SideOf(int32_t level) { return kBlock << (2 * level); }

struct Built {
  DensityBounds bounds;
  uint32_t link = 0;
  double cost = 0;  // Expected, per unit of volume.
};

// Voxels that lookups in a block may read. A cell from x to x + 2 reads voxels x .. x + 3, and with
// a margin of one voxel x - 1 .. x + 4.
constexpr int32_t kSide = kBlock + 4, kReach = kFine + 4, kCells = kBlock / kFine;
using BlockValues = std::array<float, size_t{kSide} * kSide * kSide>;
std::pair<Index3, Index3> VoxelsOfBlock(Index3 origin) {
  const Index3 lo{origin[0] - 1, origin[1] - 1, origin[2] - 1};
  return {lo, {lo[0] + kSide - 1, lo[1] + kSide - 1, lo[2] + kSide - 1}};
}

// Bounds of values times a factor.
void ReduceToCells(const BlockValues& values, float factor, std::span<DensityBounds, 64> cells) {
  // Axis by axis, the last first: reduces kSide values to kCells bounds.
  std::array<float, size_t{kSide} * kSide * kCells> z_min, z_max;
  for (int32_t row = 0; row < kSide * kSide; ++row) {
    for (int32_t c = 0; c < kCells; ++c) {
      const float* at = &values[static_cast<size_t>(row * kSide + c * kFine)];
      const auto [low, high] = std::minmax({at[0], at[1], at[2], at[3], at[4], at[5]});
      z_min[static_cast<size_t>(row * kCells + c)] = low;
      z_max[static_cast<size_t>(row * kCells + c)] = high;
    }
  }
  const auto reduce = [](const float* from, int32_t stride, bool is_min) {
    float v = from[0];
    for (int32_t i = 1; i < kReach; ++i) {
      v = is_min ? std::min(v, from[i * stride]) : std::max(v, from[i * stride]);
    }
    return v;
  };
  std::array<float, size_t{kSide} * kCells * kCells> y_min, y_max;
  for (int32_t x = 0; x < kSide; ++x) {
    for (int32_t cy = 0; cy < kCells; ++cy) {
      for (int32_t cz = 0; cz < kCells; ++cz) {
        const auto from = static_cast<size_t>((x * kSide + cy * kFine) * kCells + cz);
        const auto to = static_cast<size_t>((x * kCells + cy) * kCells + cz);
        y_min[to] = reduce(&z_min[from], kCells, true);
        y_max[to] = reduce(&z_max[from], kCells, false);
      }
    }
  }
  for (int32_t cx = 0; cx < kCells; ++cx) {
    for (int32_t c = 0; c < kCells * kCells; ++c) {
      const auto from = static_cast<size_t>(cx * kFine * kCells * kCells + c);
      cells[static_cast<size_t>(cx * kCells * kCells + c)] = {
          factor * reduce(&y_min[from], kCells * kCells, true),
          factor * reduce(&y_max[from], kCells * kCells, false)};
    }
  }
}

}  // namespace

DensityBounds GridDensitySource::Bounds() const {
  const ValueRange values = grid_.info().values;
  return {values.min * factor_, values.max * factor_};
}

std::optional<float> GridDensitySource::UniformValue(Index3 lo, Index3 hi) const {
  const auto value = grid_.UniformValue(lo, hi);
  return value ? std::optional<float>(*value * factor_) : std::nullopt;
}

void GridDensitySource::BlockBounds(Index3 origin, std::span<DensityBounds, 64> cells) const {
  BlockValues values;
  VolumeGrid::Cursor cursor(grid_);
  const auto [lo, hi] = VoxelsOfBlock(origin);
  grid_.ReadBox(lo, hi, values, &cursor);
  ReduceToCells(values, factor_, cells);
}

std::optional<DensityBounds> GridDensitySource::BlockUnion(Index3 origin) const {
  const auto range = grid_.BlockRange(origin);
  if (!range) return std::nullopt;
  return DensityBounds{factor_ * range->min, factor_ * range->max};
}

DensityBounds ComponentSource::Bounds() const {
  const float longest = grid_.info().values.max;
  return {-longest, longest};
}

std::optional<float> ComponentSource::UniformValue(Index3 lo, Index3 hi) const {
  const auto value = grid_.UniformVector(lo, hi);
  if (!value) return std::nullopt;
  return component_ == 0 ? value->x : component_ == 1 ? value->y : value->z;
}

void ComponentSource::BlockBounds(Index3 origin, std::span<DensityBounds, 64> cells) const {
  BlockValues values;
  VolumeGrid::Cursor cursor(grid_);
  const auto [lo, hi] = VoxelsOfBlock(origin);
  grid_.ReadComponentBox(component_, lo, hi, values, &cursor);
  ReduceToCells(values, 1, cells);
}

// Builds the tree below one cell, or a whole small tree.
class MajorantBuilder {
 public:
  MajorantBuilder(const DensitySource& source, const MajorantGrid& grid,
                  const MajorantGrid::Options& options, uint64_t block_budget)
      : source_(source), grid_(grid), options_(options), block_budget_(block_budget) {}

  // A cell that is built separately, by level and origin: collected in order, and appended here.
  struct Task {
    Index3 origin;
    Built built;
    std::vector<MajorantGrid::Node> nodes;
    std::vector<MajorantGrid::Brick> bricks;
  };

  // Builds the cell at `level` (8 * 4^level voxels a side). kCollect lists the cells at kTaskLevel
  // that must be divided in *tasks; kJoin takes their results from *tasks, in the same order.
  enum class Pass { kCollect, kJoin, kAll };
  Built Build(Index3 origin, int32_t level, Pass pass, std::vector<Task>* tasks) {
    const int32_t side = SideOf(level);
    if (!OverlapsBox(origin, side)) return Leaf({0, 0}, side);
    const Index3 lo{origin[0] - 1, origin[1] - 1, origin[2] - 1};
    const Index3 hi{lo[0] + side + 3, lo[1] + side + 3, lo[2] + side + 3};
    if (const auto value = source_.UniformValue(lo, hi)) return Leaf({*value, *value}, side);
    if (level == kTaskLevel && pass == Pass::kCollect) {
      tasks->push_back({origin, {}, {}, {}});
      return {};
    }
    if (level == kTaskLevel && pass == Pass::kJoin) return Join(&(*tasks)[next_task_++]);
    if (level == 0) return BuildBlock(origin);
    return BuildNode(origin, level, pass, tasks);
  }
  std::vector<MajorantGrid::Node>& nodes() { return nodes_; }
  std::vector<MajorantGrid::Brick>& bricks() { return bricks_; }

 private:
  bool OverlapsBox(Index3 origin, int32_t side) const {
    for (size_t a = 0; a < 3; ++a) {
      if (origin[a] > grid_.cell_max_[a] || int64_t{origin[a]} + side <= grid_.cell_min_[a]) {
        return false;
      }
    }
    return true;
  }
  // Distance sampling looks up at the rate of the upper bound, transmittance at that of the
  // difference; each is assumed to be half of the walks.
  Built Leaf(DensityBounds bounds, int32_t side) const {
    return {bounds, 0,
            kStepCost * kCrossingsTimesSide / side +
                kLookUpCost * options_.extinction_per_voxel *
                    (static_cast<double>(bounds.upper) - 0.5 * static_cast<double>(bounds.lower))};
  }
  // Whether a block of these bounds stays one cell, whatever its cells' bounds are: with
  // lower <= l <= u, each costs at least what one of u = l = lower does.
  bool IsOneCell(DensityBounds block) const {
    constexpr double kRounding = 1 - 1e-9;
    return block.lower >= 0 &&
           Leaf(block, kBlock).cost <= kRounding * Leaf({block.lower, block.lower}, kFine).cost;
  }
  static DensityBounds Union(DensityBounds a, DensityBounds b) {
    return {std::min(a.lower, b.lower), std::max(a.upper, b.upper)};
  }

  Built BuildBlock(Index3 origin) {
    if (block_budget_ == 0) return Leaf(source_.Bounds(), kBlock);
    --block_budget_;
    if (const auto known = source_.BlockUnion(origin); known && IsOneCell(*known)) {
      return Leaf(*known, kBlock);
    }
    MajorantGrid::Brick brick;
    source_.BlockBounds(origin, brick);
    DensityBounds all = brick[0];
    double cost = 0;
    for (const DensityBounds& cell : brick) {
      all = Union(all, cell);
      cost += Leaf(cell, kFine).cost;
    }
    Built leaf = Leaf(all, kBlock);
    if (leaf.cost <= cost / 64) return leaf;
    bricks_.push_back(brick);
    return {all, static_cast<uint32_t>(bricks_.size()), cost / 64};
  }

  Built BuildNode(Index3 origin, int32_t level, Pass pass, std::vector<Task>* tasks) {
    const int32_t side = SideOf(level - 1);
    const size_t node_count = nodes_.size(), brick_count = bricks_.size();
    nodes_.emplace_back();
    MajorantGrid::Node node;
    Built result;
    bool is_first = true;
    for (int32_t n = 0; n < 64; ++n) {
      const Index3 at{origin[0] + (n >> 4) * side, origin[1] + ((n >> 2) & 3) * side,
                      origin[2] + (n & 3) * side};
      const Built child = Build(at, level - 1, pass, tasks);
      node[static_cast<size_t>(n)] = {child.bounds, child.link};
      // Cells outside the box are never entered and do not affect the decision.
      if (OverlapsBox(at, side)) {
        result.bounds = is_first ? child.bounds : Union(result.bounds, child.bounds);
        result.cost += child.cost / 64;
        is_first = false;
      } else {
        result.cost += Leaf({0, 0}, side).cost / 64;
      }
    }
    const Built leaf = Leaf(result.bounds, SideOf(level));
    if (pass != Pass::kCollect && leaf.cost <= result.cost) {
      nodes_.resize(node_count);
      bricks_.resize(brick_count);
      return leaf;
    }
    nodes_[node_count] = node;
    result.link = static_cast<uint32_t>(node_count + 1);
    return result;
  }

  // Appends the result of a task, whose links are relative to its own beginning.
  Built Join(Task* task) {
    const auto nodes = static_cast<uint32_t>(nodes_.size());
    const auto bricks = static_cast<uint32_t>(bricks_.size());
    // Each level of a task's nodes is found from the one above: shift links from the root down.
    if (task->built.link != 0) Shift(task, task->built.link - 1, kTaskLevel, nodes, bricks);
    nodes_.insert(nodes_.end(), task->nodes.begin(), task->nodes.end());
    bricks_.insert(bricks_.end(), task->bricks.begin(), task->bricks.end());
    Built built = task->built;
    if (built.link != 0) built.link += nodes;
    *task = {};
    return built;
  }
  static void Shift(Task* task, uint32_t node, int32_t level, uint32_t nodes, uint32_t bricks) {
    for (MajorantGrid::Child& child : task->nodes[node]) {
      if (child.link == 0) continue;
      if (level > 1) Shift(task, child.link - 1, level - 1, nodes, bricks);
      child.link += level > 1 ? nodes : bricks;
    }
  }

  const DensitySource& source_;
  const MajorantGrid& grid_;
  const MajorantGrid::Options& options_;
  uint64_t block_budget_;
  size_t next_task_ = 0;
  std::vector<MajorantGrid::Node> nodes_;
  std::vector<MajorantGrid::Brick> bricks_;
};

MajorantGrid MajorantGrid::Build(const DensitySource& source, const Options& options) {
  MajorantGrid grid;
  grid.box_ = source.Box();
  int64_t extent = 0;
  for (size_t a = 0; a < 3; ++a) {
    if (!(grid.box_.lo[a] < grid.box_.hi[a])) return {};
    SHEAF_CHECK(grid.box_.lo[a] >= -0x1p25 && grid.box_.hi[a] <= 0x1p25);
    grid.cell_min_[a] = static_cast<int32_t>(std::floor(grid.box_.lo[a]));
    grid.cell_max_[a] = static_cast<int32_t>(std::ceil(grid.box_.hi[a])) - 1;
    grid.origin_[a] = grid.cell_min_[a] & ~(kBlock - 1);
    extent = std::max(extent, int64_t{grid.cell_max_[a]} - grid.origin_[a] + 1);
  }
  grid.levels_ = 1;
  while (SideOf(grid.levels_) < extent) ++grid.levels_;
  if (options.block_count_max == 0) {
    grid.bounds_ = source.Bounds();
    grid.nodes_.assign(1, Node{});
    grid.nodes_[0].fill({grid.bounds_, 0});
    return grid;
  }
  using Pass = MajorantBuilder::Pass;
  std::vector<MajorantBuilder::Task> tasks;
  if (grid.levels_ > kTaskLevel) {
    MajorantBuilder collector(source, grid, options, 0);
    collector.Build(grid.origin_, grid.levels_, Pass::kCollect, &tasks);
  }
  const uint64_t budget = options.block_count_max / std::max<uint64_t>(1, tasks.size());
  ParallelRanges(tasks.size(), 1, options.thread_count, [&](uint64_t begin, uint64_t) {
    MajorantBuilder::Task& task = tasks[begin];
    MajorantBuilder builder(source, grid, options, budget);
    task.built = builder.Build(task.origin, kTaskLevel, Pass::kAll, nullptr);
    task.nodes = std::move(builder.nodes());
    task.bricks = std::move(builder.bricks());
  });
  MajorantBuilder builder(source, grid, options, budget);
  const Built root =
      builder.Build(grid.origin_, grid.levels_, tasks.empty() ? Pass::kAll : Pass::kJoin, &tasks);
  grid.nodes_ = std::move(builder.nodes());
  grid.bricks_ = std::move(builder.bricks());
  grid.bounds_ = root.bounds;
  if (root.link == 0) {
    grid.nodes_.assign(1, Node{});
    grid.nodes_[0].fill({root.bounds, 0});
  }
  return grid;
}

std::optional<float> MajorantGrid::constant() const {
  if (nodes_.empty() || bounds_.lower != bounds_.upper) return std::nullopt;
  return bounds_.upper;
}

DensityBounds MajorantGrid::BoundsOver(const IndexBox& region) const {
  DensityBounds bounds;
  if (nodes_.empty()) return bounds;
  bool is_within = true;
  for (size_t a = 0; a < 3; ++a) {
    // Disjoint, or NaN.
    if (!(region.lo[a] <= box_.hi[a] + 1 && region.hi[a] >= box_.lo[a] - 1)) return bounds;
    is_within &= region.lo[a] >= box_.lo[a] + 1 && region.hi[a] <= box_.hi[a] - 1;
  }
  Index3 lo, hi;
  // Cells include a margin of one voxel, so a cell that begins where the region ends adds nothing.
  for (size_t a = 0; a < 3; ++a) {
    const double low = cell_min_[a], high = cell_max_[a];
    lo[a] = static_cast<int32_t>(std::clamp(std::floor(region.lo[a]), low, high));
    hi[a] = static_cast<int32_t>(std::clamp(std::ceil(region.hi[a]) - 1, double(lo[a]), high));
  }
  if (is_within) {
    constexpr float kMax = std::numeric_limits<float>::max();
    bounds = {kMax, -kMax};
  }
  Include(nodes_[0], origin_, 3 + 2 * (levels_ - 1), lo, hi, &bounds);
  return bounds;
}

void MajorantGrid::Include(const Node& node, Index3 origin, int32_t shift, Index3 lo, Index3 hi,
                           DensityBounds* bounds) const {
  Index3 first, last;
  for (size_t a = 0; a < 3; ++a) {
    first[a] = std::max(0, (lo[a] - origin[a]) >> shift);
    last[a] = std::min(3, (hi[a] - origin[a]) >> shift);
  }
  const auto add = [bounds](DensityBounds more) {
    *bounds = {std::min(bounds->lower, more.lower), std::max(bounds->upper, more.upper)};
  };
  for (int32_t x = first[0]; x <= last[0]; ++x) {
    for (int32_t y = first[1]; y <= last[1]; ++y) {
      for (int32_t z = first[2]; z <= last[2]; ++z) {
        const Child& child = node[static_cast<size_t>((x << 4) | (y << 2) | z)];
        if (child.bounds.lower >= bounds->lower && child.bounds.upper <= bounds->upper) continue;
        const Index3 at{origin[0] + (x << shift), origin[1] + (y << shift),
                        origin[2] + (z << shift)};
        bool is_inside = true;
        for (size_t a = 0; a < 3; ++a) {
          is_inside &= at[a] >= lo[a] && int64_t{at[a]} + (1 << shift) - 1 <= hi[a];
        }
        if (child.link == 0 || is_inside) {
          add(child.bounds);
        } else if (shift > 3) {
          Include(nodes_[child.link - 1], at, shift - 2, lo, hi, bounds);
        } else {
          const Brick& brick = bricks_[child.link - 1];
          for (int32_t c = 0; c < 64; ++c) {
            const Index3 cell{at[0] + (c >> 4) * kFine, at[1] + ((c >> 2) & 3) * kFine,
                              at[2] + (c & 3) * kFine};
            bool intersects = true;
            for (size_t a = 0; a < 3; ++a) {
              intersects &= cell[a] <= hi[a] && cell[a] + kFine > lo[a];
            }
            if (intersects) add(brick[static_cast<size_t>(c)]);
          }
        }
      }
    }
  }
}

uint64_t MajorantGrid::memory_bytes() const {
  return nodes_.capacity() * sizeof(Node) + bricks_.capacity() * sizeof(Brick);
}

}  // namespace sheaf::render
