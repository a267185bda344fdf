// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/gather/nearest_points.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "worker/render/sampling/event_stream.h"

namespace sheaf::render {
namespace {

// On a lattice, so that many points are equally far.
std::vector<NearestPoints::Item> LatticePoints(uint32_t count) {
  EventStream events({1, 2, 3, count});
  const auto next = [&] { return static_cast<float>(static_cast<int>(events.Uniform() * 8)); };
  std::vector<NearestPoints::Item> items;
  for (uint32_t i = 0; i < count; ++i) items.push_back({{next(), next(), next()}, i});
  return items;
}

TEST(NearestPointsTest, FindsThePointsThatASearchOfAllFinds) {
  for (const uint32_t count : {0u, 1u, 5u, 16u, 300u}) {
    const std::vector<NearestPoints::Item> items = LatticePoints(count);
    const NearestPoints points(items);
    EXPECT_EQ(points.size(), count);
    for (const Vec3f p : {Vec3f{0, 0, 0}, Vec3f{3.5f, 3, 4}, Vec3f{20, -1, 7.5f}}) {
      std::vector<std::pair<float, uint32_t>> all;
      for (const NearestPoints::Item& item : items) {
        all.emplace_back(Dot(item.p - p, item.p - p), item.id);
      }
      std::ranges::sort(all);
      std::array<uint32_t, 12> near{};
      const uint32_t found = points.Find(p, near);
      ASSERT_EQ(found, std::min<size_t>(near.size(), count));
      for (uint32_t i = 0; i < found; ++i) EXPECT_EQ(near[i], all[i].second) << i;
    }
  }
}

}  // namespace
}  // namespace sheaf::render
