// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/gather/nearest_points.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include "common/base/check.h"

namespace sheaf::render {

// The nearest items so far, in order.
struct NearestPoints::Search {
  struct Found {
    float distance_squared = 0;
    uint32_t id = 0;
    friend auto operator<=>(const Found&, const Found&) = default;
  };
  Vec3f p;
  uint32_t wanted = 0, count = 0;
  std::array<Found, kNearestMax> found{};

  bool IsTooFar(float distance_squared) const {
    return count == wanted && distance_squared > found[count - 1].distance_squared;
  }
  void Add(const Item& item) {
    const Vec3f off = item.p - p;
    const Found next{Dot(off, off), item.id};
    if (count == wanted) {
      if (!(next < found[count - 1])) return;
      --count;
    }
    uint32_t at = count++;
    for (; at > 0 && next < found[at - 1]; --at) found[at] = found[at - 1];
    found[at] = next;
  }
};

NearestPoints::NearestPoints(std::vector<Item> items)
    : items_(std::move(items)), axes_(items_.size()) {
  Divide(0, size());
}

void NearestPoints::Divide(uint32_t first, uint32_t end) {
  if (end - first < 2) return;
  Vec3f lower = items_[first].p, upper = lower;
  for (uint32_t i = first; i < end; ++i) {
    for (size_t k = 0; k < 3; ++k) {
      lower[k] = std::min(lower[k], items_[i].p[k]);
      upper[k] = std::max(upper[k], items_[i].p[k]);
    }
  }
  const Vec3f size = upper - lower;
  uint8_t axis = size.y > size.x ? 1 : 0;
  if (size.z > size[axis]) axis = 2;
  const uint32_t middle = first + (end - first) / 2;
  const auto at = [this](uint32_t i) { return items_.begin() + static_cast<ptrdiff_t>(i); };
  std::nth_element(at(first), at(middle), at(end), [axis](const Item& a, const Item& b) {
    return std::pair(a.p[axis], a.id) < std::pair(b.p[axis], b.id);
  });
  axes_[middle] = axis;
  Divide(first, middle);
  Divide(middle + 1, end);
}

void NearestPoints::Visit(uint32_t first, uint32_t end, Search* search) const {
  if (first >= end) return;
  const uint32_t middle = first + (end - first) / 2;
  const Item& item = items_[middle];
  const float off = search->p[axes_[middle]] - item.p[axes_[middle]];
  const bool is_below = off < 0;
  Visit(is_below ? first : middle + 1, is_below ? middle : end, search);
  search->Add(item);
  if (search->IsTooFar(off * off)) return;
  Visit(is_below ? middle + 1 : first, is_below ? end : middle, search);
}

uint32_t NearestPoints::Find(Vec3f p, std::span<uint32_t> ids) const {
  SHEAF_CHECK(ids.size() <= kNearestMax);
  if (ids.empty()) return 0;
  Search search{.p = p, .wanted = static_cast<uint32_t>(ids.size())};
  Visit(0, size(), &search);
  for (uint32_t i = 0; i < search.count; ++i) ids[i] = search.found[i].id;
  return search.count;
}

}  // namespace sheaf::render
