// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/math/golden_sequence.h"

#include <array>

#include "gtest/gtest.h"

namespace sheaf {
namespace {

// With 100 random numbers some tenths would have 4, and some 16.
TEST(GoldenSequenceTest, AnyHundredPointsAreEvenlySpread) {
  for (const size_t first : {size_t{0}, size_t{7}, size_t{100'000}}) {
    std::array<int, 10> counts{};
    for (size_t i = first; i < first + 100; ++i) {
      const double fraction = GoldenFraction(i);
      ASSERT_GE(fraction, 0);
      ASSERT_LT(fraction, 1);
      ++counts[static_cast<size_t>(fraction * 10)];
    }
    for (const int count : counts) EXPECT_NEAR(count, 10, 2);
  }
}

}  // namespace
}  // namespace sheaf
