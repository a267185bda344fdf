// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/light/light_part_size.h"

#include <gtest/gtest.h>

#include "common/film/exr/exr_codec.h"
#include "common/film/film_test_samples.h"
#include "common/film/light/light_pass_accumulator.h"
#include "common/film/task_kind.h"

namespace sheaf {
namespace {

constexpr PixelRect kPartWindow{0, 0, 64, 48};

// No part is larger than was foreseen, whatever its values.
TEST(LightPartSizeTest, PartsAreNoLargerThanForeseen) {
  FilmOutputs outputs;
  outputs.light_groups = {"key", "rim"};
  AddMergeBias(&outputs);
  constexpr uint64_t kHeaderBytes = 1 << 14;
  for (const uint64_t passes : {1, 4, 16}) {
    FilmTile tile(kPartWindow, {0, passes}, outputs);
    LightPassAccumulator film(&tile);
    for (uint64_t pass = 0; pass < passes; ++pass) {
      for (int32_t i = 0; i < 64 * 48 * 4; ++i) {
        const auto at = [&](uint64_t k) {
          return HashToUnit((pass * 64 * 48 * 4 + static_cast<uint64_t>(i)) * 8 + k);
        };
        film.Add(i % 64, i / 64 % 48, {at(0), at(1), at(2)}, at(3),
                 at(4) < 0.5F ? size_t{0} : size_t{1});
        film.AddBias(i % 64, i / 64 % 48, {at(5) - 0.5F, at(6), at(7)});
      }
      film.EndPass();
    }
    film.Finish();
    const uint64_t size = EncodePart(tile, {"d", "p", {}, {}, TaskKind::kLight}).size();
    const uint64_t foreseen = LightPartBytes(kPartWindow.PixelCount(), outputs, passes);
    EXPECT_LE(size, foreseen * 102 / 100 + kHeaderBytes) << passes;
    EXPECT_GE(size, foreseen / 2) << passes;
  }
}

}  // namespace
}  // namespace sheaf
