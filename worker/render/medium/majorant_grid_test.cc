// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/majorant_grid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "common/volume/volume_array.h"
#include "worker/render/medium/cloud_density.h"
#include "worker/render/sampling/event_stream.h"

namespace sheaf::render {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A block of noise at `at` in an otherwise empty array.
VolumeGrid SparseGrid(std::array<int32_t, 3> size, Index3 at, int32_t side, uint32_t seed = 1) {
  EventStream random({seed, 0, 0, 0});
  std::vector<float> values(static_cast<size_t>(size[0]) * size[1] * size[2], 0.0f);
  for (int32_t z = at[2]; z < at[2] + side; ++z) {
    for (int32_t y = at[1]; y < at[1] + side; ++y) {
      for (int32_t x = at[0]; x < at[0] + side; ++x) {
        const double u = random.Uniform();
        values[(static_cast<size_t>(z) * size[1] + y) * size[0] + x] =
            static_cast<float>(u * u * u * u * 10);
      }
    }
  }
  auto grid = VolumeGridFromArray("a", "density", {size, {}, {1, 1, 1}}, values);
  return *std::move(grid);
}

struct Ray {
  Vec3d o, d;
  double t_min = 0, t_max = kInfinity;
};

std::vector<MajorantSegment> Walk(const MajorantGrid& grid, const Ray& ray) {
  MajorantWalk walk(grid, ray.o, ray.d, ray.t_min, ray.t_max);
  std::vector<MajorantSegment> segments;
  MajorantSegment segment;
  while (walk.Next(&segment)) segments.push_back(segment);
  return segments;
}

// Checks that the segments begin, join and end to the bit.
void ExpectCovers(const std::vector<MajorantSegment>& segments, const Ray& ray) {
  double t = ray.t_min;
  for (const MajorantSegment& s : segments) {
    ASSERT_EQ(s.t0, t);
    ASSERT_LT(s.t0, s.t1);
    ASSERT_LE(s.bounds.lower, s.bounds.upper);
    t = s.t1;
  }
  ASSERT_EQ(t, ray.t_max);
}

// Rays that are numerically hard, about a box of `side` voxels.
std::vector<Ray> HardRays(double side) {
  std::vector<Ray> rays;
  EventStream random({9, 9, 9, 9});
  const auto point = [&] {
    return Vec3d{(2 * random.Uniform() - 0.5) * side, (2 * random.Uniform() - 0.5) * side,
                 (2 * random.Uniform() - 0.5) * side};
  };
  for (int i = 0; i < 400; ++i) {
    const Vec3d o = point(), towards = point() - o;
    rays.push_back({o, towards});
    rays.push_back({o, towards, 0.25, 0.75});
    Vec3d along{}, face = point();
    along[static_cast<size_t>(i % 3)] = i % 2 == 0 ? 1 : -1;
    for (size_t a = 0; a < 3; ++a) face[a] = std::round(face[a] / 8) * 8;
    rays.push_back({o, along});          // Parallel to an axis.
    rays.push_back({face, along});       // Along the edges of cells.
    rays.push_back({face, towards});     // From a corner.
    rays.push_back({face, {1, -1, 1}});  // Through edges and corners.
    rays.push_back({face, {1, 1, 0}});
    rays.push_back({o, {towards.x, 1e-300, -towards.z}});
    rays.push_back({o, {1e-310, towards.y, 0}});
    rays.push_back({{-0.5, o.y, o.z}, {0, 1, 0}});  // Within a face of the box.
  }
  rays.push_back({{3, 3, 3}, {0, 0, 0}, 0, 1});
  rays.push_back({{3e9, 3, 3}, {-1, 0, 0}});
  return rays;
}

TEST(MajorantGridTest, SegmentsCoverTheRayAndBoundItsDensity) {
  const VolumeGrid grid = SparseGrid({90, 70, 60}, {20, 10, 5}, 45);
  uint64_t cell_count = 0;
  for (const double extinction : {0.001, 0.1, 100.0}) {
    const MajorantGrid majorants =
        MajorantGrid::Build(GridDensitySource(grid, 2), {.extinction_per_voxel = extinction});
    EXPECT_EQ(majorants.bounds(), (DensityBounds{0, 2 * grid.info().values.max}));
    VolumeGrid::Cursor cursor(grid);
    for (const Ray& ray : HardRays(90)) {
      const auto segments = Walk(majorants, ray);
      ExpectCovers(segments, ray);
      for (const MajorantSegment& s : segments) {
        if (std::isinf(s.t1) || s.bounds.upper == 0) continue;
        for (const double u : {0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0}) {
          const double t = u == 1 ? s.t1 : s.t0 + u * (s.t1 - s.t0);
          const float v = 2 * grid.At(ray.o + t * ray.d, &cursor);
          ASSERT_LE(v, s.bounds.upper);
          ASSERT_GE(v, s.bounds.lower);
        }
      }
    }
    EXPECT_GT(majorants.cell_count(), cell_count);
    cell_count = majorants.cell_count();
  }
}

TEST(MajorantGridTest, VacuumSegmentsAreEmpty) {
  const VolumeGrid grid = SparseGrid({90, 70, 60}, {20, 10, 5}, 45);
  const MajorantGrid majorants = MajorantGrid::Build(GridDensitySource(grid), {});
  VolumeGrid::Cursor cursor(grid);
  double seen = 0;
  for (const Ray& ray : HardRays(90)) {
    for (const MajorantSegment& s : Walk(majorants, ray)) {
      if (s.bounds.upper > 0) continue;
      for (int i = 0; i <= 32 && !std::isinf(s.t1); ++i) {
        const Vec3d p = ray.o + (s.t0 + i / 32.0 * (s.t1 - s.t0)) * ray.d;
        bool inside = true;  // Outside the box the density is 0, whatever the voxels.
        for (size_t a = 0; a < 3; ++a) {
          inside &= p[a] > grid.box().lo[a] + 1e-9 && p[a] < grid.box().hi[a] - 1e-9;
        }
        if (inside) {
          ASSERT_EQ(grid.At(p, &cursor), 0);
          seen += 1;
        }
      }
    }
  }
  EXPECT_GT(seen, 1000);
}

TEST(MajorantGridTest, ScalingTheRayScalesSegmentsExactly) {
  const VolumeGrid grid = SparseGrid({90, 70, 60}, {20, 10, 5}, 45);
  const MajorantGrid majorants = MajorantGrid::Build(GridDensitySource(grid), {});
  for (const Ray& ray : HardRays(90)) {
    if (std::fabs(ray.d.x) < 1e-200 || std::fabs(ray.d.y) < 1e-200) continue;
    const auto segments = Walk(majorants, ray);
    for (const int k : {-40, 40}) {
      Ray scaled = ray;
      scaled.d = ray.d * std::ldexp(1.0, -k);
      scaled.t_min = std::ldexp(ray.t_min, k);
      scaled.t_max = std::ldexp(ray.t_max, k);
      const auto other = Walk(majorants, scaled);
      ASSERT_EQ(other.size(), segments.size());
      for (size_t i = 0; i < other.size(); ++i) {
        ASSERT_EQ(other[i].t1, std::ldexp(segments[i].t1, k));
        ASSERT_EQ(other[i].bounds, segments[i].bounds);
      }
    }
  }
}

TEST(MajorantGridTest, EmptySpaceTakesFewSteps) {
  const VolumeGrid grid = SparseGrid({600, 200, 200}, {500, 100, 100}, 30);
  const MajorantGrid majorants =
      MajorantGrid::Build(GridDensitySource(grid), {.extinction_per_voxel = 1});
  const auto segments = Walk(majorants, {{-10, 50, 50}, {1, 0, 0}, 0, 1000});
  EXPECT_LE(segments.size(), 20u);
  EXPECT_LT(majorants.memory_bytes(), grid.info().memory_bytes / 4);
}

TEST(MajorantGridTest, ThreadCountDoesNotMatter) {
  const VolumeGrid grid = SparseGrid({1200, 40, 600}, {480, 2, 490}, 36);
  const MajorantGrid one = MajorantGrid::Build(GridDensitySource(grid), {.thread_count = 1});
  const MajorantGrid three = MajorantGrid::Build(GridDensitySource(grid), {.thread_count = 3});
  EXPECT_EQ(one.cell_count(), three.cell_count());
  VolumeGrid::Cursor cursor(grid);
  int lumpy_count = 0;
  EventStream random({3, 1, 4, 1});
  for (int i = 0; i < 2000; ++i) {
    const Vec3d o{random.Uniform() * 1200, random.Uniform() * 40, random.Uniform() * 600};
    const Ray ray{
        o,
        Vec3d{480 + 36 * random.Uniform(), 2 + 36 * random.Uniform(), 490 + 36 * random.Uniform()} -
            o,
        0, 2};
    const auto a = Walk(one, ray), b = Walk(three, ray);
    ASSERT_EQ(a.size(), b.size());
    for (size_t s = 0; s < a.size(); ++s) {
      ASSERT_EQ(a[s].bounds, b[s].bounds);
      ASSERT_EQ(a[s].t1, b[s].t1);
      lumpy_count += a[s].bounds.upper > 0;
      const float v = grid.At(ray.o + 0.5 * (a[s].t0 + a[s].t1) * ray.d, &cursor);
      const bool outside = a[s].t0 == 0 || a[s].t1 == 2;
      ASSERT_TRUE(outside || (v <= a[s].bounds.upper && v >= a[s].bounds.lower));
    }
  }
  EXPECT_GT(lumpy_count, 10000);
}

// Compares regions of all sizes, inside and outside the box, with the voxels themselves.
TEST(MajorantGridTest, BoundsOverRegionsHoldAndAreTight) {
  const VolumeGrid grid = SparseGrid({40, 44, 300}, {9, 12, 200}, 19);
  // Dense enough that every cell is divided where it can be.
  const MajorantGrid majorants =
      MajorantGrid::Build(GridDensitySource(grid), {.extinction_per_voxel = 1e6});
  EventStream random({4, 5, 6, 7});
  VolumeGrid::Cursor cursor(grid);
  const IndexBox& box = grid.box();
  int lumpy_count = 0, within_count = 0;
  for (int i = 0; i < 3000; ++i) {
    IndexBox region;
    for (size_t a = 0; a < 3; ++a) {
      const double size = std::pow(2.0, 6 * random.Uniform() - 1);
      region.lo[a] = (a == 2 ? 180 : -5) + 50 * random.Uniform();
      region.hi[a] = region.lo[a] + size;
    }
    const DensityBounds bounds = majorants.BoundsOver(region);
    float least = 1e9f, most = -1e9f;
    const auto add = [&](float v) {
      least = std::min(least, v);
      most = std::max(most, v);
    };
    bool is_within = true;
    for (size_t a = 0; a < 3; ++a) {
      is_within &= region.lo[a] >= box.lo[a] + 5 && region.hi[a] <= box.hi[a] - 5;
    }
    if (!is_within) add(0);
    for (int k = 0; k < 30; ++k) {
      Vec3d p;
      for (size_t a = 0; a < 3; ++a) {
        const double length = region.hi[a] - region.lo[a];
        p[a] = region.lo[a] - 0.99 + (length + 1.98) * random.Uniform();
      }
      bool is_in_box = true;
      for (size_t a = 0; a < 3; ++a) is_in_box &= p[a] >= box.lo[a] && p[a] <= box.hi[a];
      const float density = is_in_box ? grid.At(p, &cursor) : 0;
      ASSERT_GE(density, bounds.lower);
      ASSERT_LE(density, bounds.upper);
    }
    // Cells add up to 2 voxels, their margins 2 more.
    for (int x = int(region.lo.x) - 5; x <= region.hi.x + 5; ++x) {
      for (int y = int(region.lo.y) - 5; y <= region.hi.y + 5; ++y) {
        for (int z = int(region.lo.z) - 5; z <= region.hi.z + 5; ++z) {
          add(grid.At({double(x), double(y), double(z)}, &cursor));
        }
      }
    }
    ASSERT_LE(bounds.upper, most);
    ASSERT_GE(bounds.lower, least);
    lumpy_count += bounds.upper > bounds.lower;
    within_count += is_within;
  }
  EXPECT_GT(lumpy_count, 500);
  EXPECT_GT(within_count, 300);
  EXPECT_EQ(majorants.BoundsOver({{-90, 0, 0}, {-80, 40, 40}}), DensityBounds{});
  EXPECT_EQ(majorants.BoundsOver({{-1e300, -1e300, -1e300}, {1e300, 1e300, 1e300}}),
            majorants.bounds());
  EXPECT_EQ(MajorantGrid().BoundsOver({{0, 0, 0}, {1, 1, 1}}), DensityBounds{});
}

// V3: an empty grid is a valid medium.
TEST(MajorantGridTest, EmptyGridIsVacuum) {
  const MajorantGrid none;
  const auto segments = Walk(none, {{1, 2, 3}, {0, 0, 1}, 0, kInfinity});
  ASSERT_EQ(segments.size(), 1u);
  EXPECT_EQ(segments[0].bounds, DensityBounds{});
  const VolumeGrid zeros = SparseGrid({20, 20, 20}, {0, 0, 0}, 0);
  const MajorantGrid empty = MajorantGrid::Build(GridDensitySource(zeros), {});
  EXPECT_EQ(empty.constant(), 0.0f);
  for (const MajorantSegment& s : Walk(empty, {{-5, 2, 3}, {1, 0.1, 0}})) {
    EXPECT_EQ(s.bounds, DensityBounds{});
  }
}

TEST(MajorantGridTest, ConstantGridIsDetected) {
  const std::vector<float> values(40 * 40 * 40, 0.75f);
  auto grid = VolumeGridFromArray("a", "density", {{40, 40, 40}, {}, {1, 1, 1}}, values);
  ASSERT_TRUE(grid.ok());
  EXPECT_EQ(MajorantGrid::Build(GridDensitySource(*grid), {}).constant(), std::nullopt);
  grid->set_box({{8, 8, 8}, {24, 24, 24}});
  const MajorantGrid inner = MajorantGrid::Build(GridDensitySource(*grid, 2), {});
  EXPECT_EQ(inner.constant(), 1.5f);
  EXPECT_EQ(inner.cell_count(), 64u);
}

TEST(CloudDensityTest, NoiseIsBoundedAndBoundsHold) {
  EventStream random({2, 7, 1, 8});
  double least = 1, most = -1;
  for (int i = 0; i < 200000; ++i) {
    const double v = GradientNoise(
        {random.Uniform() * 50 - 25, random.Uniform() * 50 - 25, random.Uniform() * 50 - 25});
    ASSERT_LE(std::fabs(v), 1);
    least = std::min(least, v);
    most = std::max(most, v);
  }
  EXPECT_LT(least, -0.6);
  EXPECT_GT(most, 0.6);
  for (const double density : {0.25, 1.0, 4.0}) {
    const CloudDensity cloud({.density = density, .lo = {-1, 0, -1}, .hi = {1, 1, 1}});
    const MajorantGrid majorants = MajorantGrid::Build(cloud, {.extinction_per_voxel = 0.2});
    int cloudy = 0;
    for (int i = 0; i < 300; ++i) {
      Ray ray{{random.Uniform() * 64, -5, random.Uniform() * 64}, {}, 0, 1};
      ray.d = Vec3d{random.Uniform() * 64, 40, random.Uniform() * 64} - ray.o;
      const auto segments = Walk(majorants, ray);
      ExpectCovers(segments, ray);
      for (const MajorantSegment& s : segments) {
        for (int k = 0; k <= 8 && s.bounds.upper > 0; ++k) {
          const Vec3d p = ray.o + (s.t0 + k / 8.0 * (s.t1 - s.t0)) * ray.d;
          const double v = cloud.At(cloud.index_offset() + p * cloud.voxel_size());
          ASSERT_LE(v, s.bounds.upper);
          ASSERT_GE(v, s.bounds.lower);
          cloudy += v > 0 && v < 1;
        }
      }
    }
    EXPECT_GT(cloudy, 100);
  }
}

// Cells that are not divided fill the tree without overlapping, and a point's cell is that in which
// a walk meets it.
TEST(MajorantGridTest, CellsHaveNumbers) {
  const VolumeGrid volume = SparseGrid({70, 40, 33}, {20, 3, 9}, 24);
  const MajorantGrid grid =
      MajorantGrid::Build(GridDensitySource(volume), {.extinction_per_voxel = 0.5});
  const std::vector<MajorantGrid::Cell> cells = grid.Cells();
  ASSERT_GT(cells.size(), 500u);
  std::vector<bool> is_used(grid.cell_count(), false);
  for (const MajorantGrid::Cell& cell : cells) {
    ASSERT_LT(cell.id, grid.cell_count());
    ASSERT_FALSE(is_used[cell.id]);
    is_used[cell.id] = true;
  }
  EventStream random({9, 0, 0, 0});
  for (int i = 0; i < 200; ++i) {
    const Vec3d o{random.Uniform() * 70, random.Uniform() * 40, random.Uniform() * 33};
    const Vec3d d{random.Uniform() - 0.5, random.Uniform() - 0.5, random.Uniform() - 0.5};
    for (const MajorantSegment& segment : Walk(grid, {o, d, 0, 20})) {
      const Vec3d p = o + 0.5 * (segment.t0 + segment.t1) * d;
      bool is_inside = true;
      for (size_t a = 0; a < 3; ++a) {
        is_inside &= p[a] > grid.box().lo[a] && p[a] < grid.box().hi[a];
      }
      if (!is_inside || segment.t1 - segment.t0 < 1e-9) continue;
      const MajorantGrid::Cell cell = grid.CellAt(p);
      ASSERT_TRUE(is_used[cell.id]);
      ASSERT_EQ(cell.bounds, segment.bounds);
      for (size_t a = 0; a < 3; ++a)
        ASSERT_TRUE(p[a] >= cell.lo[a] && p[a] <= cell.lo[a] + cell.size);
    }
  }
}

}  // namespace
}  // namespace sheaf::render
