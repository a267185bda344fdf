// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/guiding/guiding_shares.h"

#include <algorithm>

#include "common/base/vector_bytes.h"

namespace sheaf::render {

GuidingShares::GuidingShares(size_t region_count) : moments_(region_count) {}

void GuidingShares::Add(uint32_t region, float share, double scattered, double scattering_part) {
  const double found = scattered * kGuidingShareUnit;
  const double by_scattering = std::min(1.0, scattering_part) / (1 - static_cast<double>(share));
  const double by_field = (1 - std::min(1.0, scattering_part)) / static_cast<double>(share);
  for (size_t i = 0; i < kGuidingShares.size(); ++i) {
    const auto tried = static_cast<double>(kGuidingShares[i]);
    // The density with this share over that with which the direction was taken.
    const double density = (1 - tried) * by_scattering + tried * by_field;
    const double square = std::min(found * found / density, kGuidingSquareMax);
    if (square >= 0.5) {
      moments_[region][i].fetch_add(static_cast<uint64_t>(square + 0.5), std::memory_order_relaxed);
    }
  }
}

float GuidingShares::BestOf(uint32_t region, float share) const {
  const auto moment = [&](size_t i) { return moments_[region][i].load(std::memory_order_relaxed); };
  size_t best = 0;
  for (size_t i = 1; i < kGuidingShares.size(); ++i) {
    const bool is_kept = kGuidingShares[i] == share && moment(i) == moment(best);
    if (moment(i) < moment(best) || is_kept) best = i;
  }
  return moment(best) > 0 ? kGuidingShares[best] : share;
}

uint64_t GuidingShares::memory_bytes() const { return sizeof(*this) + VectorBytes(moments_); }

}  // namespace sheaf::render
