// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/majorant_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/base/check.h"
#include "common/base/parallel.h"

namespace sheaf::render {
namespace {

constexpr int32_t kBlock = 8;      // Voxels a side: a leaf of the volume grid.
constexpr int32_t kFine = 2;       // Voxels a side of the finest cells.
constexpr int32_t kTaskLevel = 3;  // Cells of 8 * 4^3 voxels a side are built independently.
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// What a step to the next cell and what a tentative collision cost, relative to each other, as
// volume_bench measures them.
constexpr double kStepCost = 1, kLookUpCost = 1;
// A cube of side L is met by 3 / (2 L) random lines per unit of volume. Source: Cauchy's formula.
constexpr double kCrossingsTimesSide = 1.5;

int32_t SideOf(int32_t level) { return kBlock << (2 * level); }

struct Built {
  DensityBounds bounds;
  uint32_t link = 0;
  double cost = 0;  // Expected, per unit of volume.
};

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
  // A cell from x to x + 2 is looked up in voxels x .. x + 3, and a voxel off in x - 1 .. x + 4.
  constexpr int32_t kSide = kBlock + 4, kReach = kFine + 4, kCells = kBlock / kFine;
  std::array<float, size_t{kSide} * kSide * kSide> values;
  const Index3 lo{origin[0] - 1, origin[1] - 1, origin[2] - 1};
  VolumeGrid::Cursor cursor(grid_);
  grid_.ReadBox(lo, {lo[0] + kSide - 1, lo[1] + kSide - 1, lo[2] + kSide - 1}, values, &cursor);
  // Axis by axis, the last first: kSide values become kCells bounds.
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
          factor_ * reduce(&y_min[from], kCells * kCells, true),
          factor_ * reduce(&y_max[from], kCells * kCells, false)};
    }
  }
}

// Builds the tree below one cell, or the whole of a small one.
class MajorantBuilder {
 public:
  MajorantBuilder(const DensitySource& source, const MajorantGrid& grid,
                  const MajorantGrid::Options& options, uint64_t block_budget)
      : source_(source), grid_(grid), options_(options), block_budget_(block_budget) {}

  // Cells that are built elsewhere, by level and origin: found in order, appended here.
  struct Task {
    Index3 origin;
    Built built;
    std::vector<MajorantGrid::Node> nodes;
    std::vector<MajorantGrid::Brick> bricks;
  };

  // The cell at `level` (8 * 4^level voxels a side). Cells at kTaskLevel are listed in *tasks
  // where they must be divided and `collect`; otherwise they are taken from *tasks, in order.
  enum class Pass { kCollect, kJoin, kAll };
  Built Build(Index3 origin, int32_t level, Pass pass, std::vector<Task>* tasks) {
    const int32_t side = SideOf(level);
    if (!MeetsBox(origin, side)) return Leaf({0, 0}, side);
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
  bool MeetsBox(Index3 origin, int32_t side) const {
    for (size_t a = 0; a < 3; ++a) {
      if (origin[a] > grid_.cell_max_[a] || int64_t{origin[a]} + side <= grid_.cell_min_[a]) {
        return false;
      }
    }
    return true;
  }
  // Flights look up at the rate of the upper bound, transmittances at that of the difference; half
  // of the walks are of each kind.
  Built Leaf(DensityBounds bounds, int32_t side) const {
    return {bounds, 0,
            kStepCost * kCrossingsTimesSide / side +
                kLookUpCost * options_.extinction_per_voxel *
                    (static_cast<double>(bounds.upper) - 0.5 * static_cast<double>(bounds.lower))};
  }
  static DensityBounds Union(DensityBounds a, DensityBounds b) {
    return {std::min(a.lower, b.lower), std::max(a.upper, b.upper)};
  }

  Built BuildBlock(Index3 origin) {
    if (block_budget_ == 0) return Leaf(source_.Bounds(), kBlock);
    --block_budget_;
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
      // What lies outside the box is never met: it decides nothing.
      if (MeetsBox(at, side)) {
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

  // Appends what a task built; its links count from its own beginning.
  Built Join(Task* task) {
    const auto nodes = static_cast<uint32_t>(nodes_.size());
    const auto bricks = static_cast<uint32_t>(bricks_.size());
    // The levels of a task's nodes follow from their place: shift links from the root down.
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

uint64_t MajorantGrid::memory_bytes() const {
  return nodes_.capacity() * sizeof(Node) + bricks_.capacity() * sizeof(Brick);
}

MajorantWalk::MajorantWalk(const MajorantGrid& grid, Vec3d o, Vec3d d, double t_min, double t_max)
    : grid_(grid), o_(o), d_(d), t_(t_min), t_box_begin_(t_min), t_box_end_(t_max), t_max_(t_max) {
  bool meets = !grid.nodes_.empty();
  for (size_t a = 0; a < 3; ++a) {
    inverse_d_[a] = 1 / d[a];
    // What moves so slowly that its inverse is infinite does not move.
    if (!std::isfinite(inverse_d_[a])) {
      d_[a] = 0;
      meets &= o[a] >= grid.box_.lo[a] && o[a] <= grid.box_.hi[a];
      continue;
    }
    const double t_lo = (grid.box_.lo[a] - o[a]) * inverse_d_[a];
    const double t_hi = (grid.box_.hi[a] - o[a]) * inverse_d_[a];
    t_box_begin_ = std::max(t_box_begin_, std::min(t_lo, t_hi));
    t_box_end_ = std::min(t_box_end_, std::max(t_lo, t_hi));
  }
  if (!meets || !(t_box_begin_ < t_box_end_)) {
    phase_ = Phase::kAfter;
    return;
  }
  for (size_t a = 0; a < 3; ++a) {
    const double p = std::floor(o_[a] + (d_[a] == 0 ? 0 : t_box_begin_ * d_[a]));
    const double low = grid.cell_min_[a], high = grid.cell_max_[a];
    cell_[a] = static_cast<int32_t>(std::min(std::max(p, low), high));
  }
}

bool MajorantWalk::Next(MajorantSegment* segment) {
  if (phase_ == Phase::kBefore) {
    phase_ = Phase::kInside;
    if (t_ < t_box_begin_) {
      *segment = {t_, t_box_begin_, {}};
      t_ = t_box_begin_;
      return true;
    }
  }
  if (phase_ == Phase::kInside && NextInside(segment)) return true;
  if (phase_ == Phase::kAfter) {
    phase_ = Phase::kDone;
    if (t_ < t_max_) {
      *segment = {t_, t_max_, {}};
      t_ = t_max_;
      return true;
    }
  }
  return false;
}

bool MajorantWalk::NextInside(MajorantSegment* segment) {
  while (phase_ == Phase::kInside) {
    Index3 lo;
    int32_t size;
    const DensityBounds bounds = FindCell(&lo, &size);
    double exit = kInfinity;
    size_t axis = 3;
    for (size_t a = 0; a < 3; ++a) {
      if (d_[a] == 0) continue;
      const double plane = d_[a] > 0 ? lo[a] + size : lo[a];
      const double t = (plane - o_[a]) * inverse_d_[a];
      if (t < exit) {
        exit = t;
        axis = a;
      }
    }
    const double begin = t_;
    if (axis == 3 || exit >= t_box_end_) {
      t_ = t_box_end_;
      phase_ = Phase::kAfter;
    } else {
      t_ = std::max(t_, exit);
      Leave(axis, lo, size);
      // Out of the box by cells: what is left of it by numbers is rounding, and this cell's.
      if (phase_ == Phase::kAfter) t_ = t_box_end_;
    }
    if (begin < t_) {
      *segment = {begin, t_, bounds};
      return true;
    }
  }
  return false;
}

void MajorantWalk::Leave(size_t axis, Index3 lo, int32_t size) {
  for (size_t a = 0; a < 3; ++a) {
    if (d_[a] == 0) continue;
    if (a == axis) {
      cell_[a] = d_[a] > 0 ? lo[a] + size : lo[a] - 1;
      if (cell_[a] < grid_.cell_min_[a] || cell_[a] > grid_.cell_max_[a]) phase_ = Phase::kAfter;
      continue;
    }
    // Where the point is, but within the cell that is left, and never back.
    const double p = std::floor(o_[a] + t_ * d_[a]);
    const double low = d_[a] > 0 ? cell_[a] : lo[a];
    const double high = d_[a] > 0 ? lo[a] + size - 1 : cell_[a];
    cell_[a] = static_cast<int32_t>(std::min(std::max(p, low), high));
    cell_[a] = std::clamp(cell_[a], grid_.cell_min_[a], grid_.cell_max_[a]);
  }
}

DensityBounds MajorantWalk::FindCell(Index3* lo, int32_t* size) const {
  const auto x = static_cast<uint32_t>(cell_[0] - grid_.origin_[0]);
  const auto y = static_cast<uint32_t>(cell_[1] - grid_.origin_[1]);
  const auto z = static_cast<uint32_t>(cell_[2] - grid_.origin_[2]);
  const auto child = [&](int32_t shift) {
    return (((x >> shift) & 3) << 4) | (((y >> shift) & 3) << 2) | ((z >> shift) & 3);
  };
  const auto place = [&](int32_t shift) {
    *size = 1 << shift;
    for (size_t a = 0; a < 3; ++a) {
      (*lo)[a] = cell_[a] - ((cell_[a] - grid_.origin_[a]) & (*size - 1));
    }
  };
  const MajorantGrid::Node* node = grid_.nodes_.data();
  int32_t shift = 3 + 2 * (grid_.levels_ - 1);
  for (;; shift -= 2) {
    const MajorantGrid::Child& c = (*node)[child(shift)];
    if (c.link == 0) {
      place(shift);
      return c.bounds;
    }
    if (shift == 3) {
      place(1);
      return grid_.bricks_[c.link - 1][child(1)];
    }
    node = &grid_.nodes_[c.link - 1];
  }
}

}  // namespace sheaf::render
