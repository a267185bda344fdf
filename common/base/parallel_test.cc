// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/parallel.h"

#include <gtest/gtest.h>

#include <new>

namespace sheaf {
namespace {

TEST(ParallelTest, EveryRangeRunsOnce) {
  std::vector<int> done(1000, 0);
  ParallelRanges(done.size(), 7, 4, [&](uint64_t begin, uint64_t end) {
    for (uint64_t i = begin; i < end; ++i) ++done[i];
  });
  EXPECT_EQ(std::count(done.begin(), done.end(), 1), 1000);
}

TEST(ParallelTest, OutOfMemoryInAThreadIsRethrownByTheLoop) {
  std::atomic<int> begun{0};
  const auto lack = [&](uint64_t, uint64_t) {
    if (++begun > 3) throw std::bad_alloc();
  };
  EXPECT_THROW(ParallelRanges(100, 1, 4, lack), std::bad_alloc);
  EXPECT_LT(begun, 100);
}

}  // namespace
}  // namespace sheaf
