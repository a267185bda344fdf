// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/math/mix_bits.h"

#include <gtest/gtest.h>

namespace sheaf {
namespace {

// The first outputs of SplitMix64 with seed 0, as published: images depend on every bit.
TEST(MixBitsTest, MatchesSplitMix64) {
  constexpr uint64_t kStep = 0x9e3779b97f4a7c15u;
  EXPECT_EQ(MixBits(kStep), 0xe220a8397b1dcdafu);
  EXPECT_EQ(MixBits(2 * kStep), 0x6e789e6aa1b965f4u);
  EXPECT_EQ(MixBits(3 * kStep), 0x06c45d188009454fu);
}

}  // namespace
}  // namespace sheaf
