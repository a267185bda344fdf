// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/merged_medium.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "common/base/parallel.h"
#include "common/base/vector_bytes.h"

namespace sheaf::render {
namespace {

constexpr int32_t kBlockSide = 8, kFinestSide = 2;
constexpr uint64_t kCellsPerRange = 1024;  // That a thread lists members for at a time.

// The box around a transformed box.
IndexBox BoxOf(const Affine& transform, const IndexBox& box) {
  Bounds bounds;
  for (int corner = 0; corner < 8; ++corner) {
    bounds.Add(transform.Point({(corner & 1) != 0 ? box.hi.x : box.lo.x,
                                (corner & 2) != 0 ? box.hi.y : box.lo.y,
                                (corner & 4) != 0 ? box.hi.z : box.lo.z}));
  }
  return {bounds.lower(), bounds.upper()};
}

// The voxels from `lo` on, `side` of them on each axis, and one more on all sides.
IndexBox WithMargin(Index3 lo, int32_t side) {
  IndexBox box;
  for (size_t a = 0; a < 3; ++a) {
    box.lo[a] = static_cast<double>(lo[a]) - 1;
    box.hi[a] = static_cast<double>(lo[a]) + side + 1;
  }
  return box;
}

// The sum of the members' densities, each times its extinction.
class SumSource : public DensitySource {
 public:
  SumSource(const std::vector<MergedMedium::Member>& members, const Affine& render_from_cells,
            const IndexBox& box)
      : members_(members), box_(box) {
    for (const MergedMedium::Member& member : members) {
      index_from_cells_.push_back(Inverse(member.density->render_from_index()) * render_from_cells);
    }
  }

  // Bounds of a member's density over a region of cell space.
  DensityBounds BoundsOf(size_t member, const IndexBox& region) const {
    return members_[member].density->majorants().BoundsOver(
        BoxOf(index_from_cells_[member], region));
  }
  IndexBox Box() const override { return box_; }
  DensityBounds Bounds() const override { return Sum(box_); }
  std::optional<float> UniformValue(Index3 lo, Index3 hi) const override {
    const IndexBox region{{double(lo[0]), double(lo[1]), double(lo[2])},
                          {double(hi[0]), double(hi[1]), double(hi[2])}};
    const DensityBounds sum = Sum(region);
    return sum.lower == sum.upper ? std::optional<float>(sum.upper) : std::nullopt;
  }
  void BlockBounds(Index3 origin, std::span<DensityBounds, 64> cells) const override {
    std::fill(cells.begin(), cells.end(), DensityBounds{});
    for (size_t m = 0; m < members_.size(); ++m) {
      if (!(BoundsOf(m, WithMargin(origin, kBlockSide)).upper > 0)) continue;
      for (int32_t n = 0; n < 64; ++n) {
        const Index3 lo{origin[0] + (n >> 4) * kFinestSide,
                        origin[1] + ((n >> 2) & 3) * kFinestSide,
                        origin[2] + (n & 3) * kFinestSide};
        Add(m, BoundsOf(m, WithMargin(lo, kFinestSide)), &cells[static_cast<size_t>(n)]);
      }
    }
  }

 private:
  void Add(size_t member, DensityBounds bounds, DensityBounds* sum) const {
    const auto factor = static_cast<float>(members_[member].extinction_max);
    sum->lower += factor * bounds.lower;
    sum->upper += factor * bounds.upper;
  }
  DensityBounds Sum(const IndexBox& region) const {
    DensityBounds sum;
    for (size_t m = 0; m < members_.size(); ++m) Add(m, BoundsOf(m, region), &sum);
    return sum;
  }

  const std::vector<MergedMedium::Member>& members_;
  IndexBox box_;
  std::vector<Affine> index_from_cells_;  // By member: its index space.
};

// The shortest side of a member's voxels.
double VoxelOf(const HeterogeneousMedium& density) {
  const Affine& a = density.render_from_index();
  return std::min({Length(a.x), Length(a.y), Length(a.z)});
}

}  // namespace

MergedMedium::MergedMedium(std::vector<Member> members, const Bounds& box, int thread_count)
    : members_(std::move(members)), origin_(box.lower()) {
  const Vec3d size = box.upper() - box.lower();
  const double longest = std::max({size.x, size.y, size.z});
  double voxel = std::numeric_limits<double>::infinity();
  for (const Member& member : members_) voxel = std::min(voxel, VoxelOf(*member.density));
  voxel = std::max(voxel, longest / kMergedSideMax);
  per_unit_ = 1 / voxel;
  const Affine render_from_cells{{voxel, 0, 0}, {0, voxel, 0}, {0, 0, voxel}, origin_};
  const SumSource source(members_, render_from_cells, {{0, 0, 0}, per_unit_ * size});
  tree_ =
      MajorantGrid::Build(source, {.extinction_per_voxel = voxel, .thread_count = thread_count});
  const std::vector<MajorantGrid::Cell> cells = tree_.Cells();
  std::vector<std::vector<Entry>> lists(tree_.cell_count());
  ParallelRanges(cells.size(), kCellsPerRange, thread_count, [&](uint64_t begin, uint64_t end) {
    for (uint64_t i = begin; i < end; ++i) {
      if (!(cells[i].bounds.upper > 0)) continue;
      const IndexBox region = WithMargin(cells[i].lo, cells[i].size);
      for (uint32_t m = 0; m < members_.size(); ++m) {
        const DensityBounds bounds = source.BoundsOf(m, region);
        if (bounds.upper > 0) lists[cells[i].id].push_back({m, bounds});
      }
    }
  });
  first_.reserve(lists.size() + 1);
  for (const std::vector<Entry>& list : lists) {
    first_.push_back(static_cast<uint32_t>(entries_.size()));
    entries_.insert(entries_.end(), list.begin(), list.end());
  }
  first_.push_back(static_cast<uint32_t>(entries_.size()));
  entries_.shrink_to_fit();
}

uint64_t MergedMedium::memory_bytes() const {
  return tree_.memory_bytes() + VectorBytes(members_, first_, entries_);
}

}  // namespace sheaf::render
