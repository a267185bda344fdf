// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/id_sums.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/math/double_float.h"

namespace sheaf {
namespace {

// Moves the ids of least weight, and of equal weights the greater ids, to kNoId until few enough
// are left.
void DropSmallest(IdList* list) {
  const size_t first = list->front().id == kNoId ? 1 : 0;
  if (list->size() - first <= kIdsPerPixelMax) return;
  std::vector<IdWeight> by_weight(list->begin() + static_cast<ptrdiff_t>(first), list->end());
  std::sort(by_weight.begin(), by_weight.end(), [](const IdWeight& a, const IdWeight& b) {
    const double wa = std::fabs(a.weight), wb = std::fabs(b.weight);
    return wa != wb ? wa > wb : a.id < b.id;
  });
  double rest = first == 1 ? list->front().weight : 0;
  for (size_t i = kIdsPerPixelMax; i < by_weight.size(); ++i) {
    rest = DoubleFloat::Round(rest + by_weight[i].weight);
  }
  by_weight.resize(kIdsPerPixelMax);
  by_weight.push_back({kNoId, rest});
  std::sort(by_weight.begin(), by_weight.end(),
            [](const IdWeight& a, const IdWeight& b) { return a.id < b.id; });
  *list = std::move(by_weight);
}

}  // namespace

void MergeIds(const IdList& right, IdList* left, IdList* scratch) {
  if (right.empty()) return;
  scratch->clear();
  auto a = left->begin();
  for (const IdWeight& b : right) {
    while (a != left->end() && a->id < b.id) scratch->push_back(*a++);
    if (a != left->end() && a->id == b.id) {
      scratch->push_back({b.id, DoubleFloat::Round(a++->weight + b.weight)});
    } else {
      scratch->push_back(b);
    }
  }
  scratch->insert(scratch->end(), a, left->end());
  std::swap(*left, *scratch);
  if (left->size() > kIdsPerPixelMax) DropSmallest(left);
}

size_t IdSums::size_bytes() const {
  size_t bytes = pixels.capacity() * sizeof(IdList);
  for (const IdList& list : pixels) bytes += list.capacity() * sizeof(IdWeight);
  constexpr size_t kNodeBytes = 96;  // Size of a map node with a short name.
  for (const auto& [id, name] : names) bytes += kNodeBytes + name.capacity();
  return bytes;
}

}  // namespace sheaf
