// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Estimates of the tiles of a small frame, for ExpectAgreement.
#pragma once

#include <vector>

#include "tests/support/light_film_sums.h"
#include "tests/support/technique_agreement.h"

namespace sheaf::render {

// Estimates the sum of R, G and B, over the paths of all kinds.
inline std::vector<testing::Estimate> EstimatesOfBoth(const BothFilms& films) {
  return sheaf::testing::EstimatesOfTiles(
      kReplicateCount,
      [&](uint32_t r, size_t pixel) {
        return films.Mean(r, 0, pixel) + films.Mean(r, 1, pixel) + films.Mean(r, 2, pixel);
      },
      [](uint32_t, size_t) { return 1.0; });
}

}  // namespace sheaf::render
