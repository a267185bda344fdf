// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/view/histogram.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>
#include <vector>

namespace sheaf::coordinator {
namespace {

constexpr double kBounds[] = {0.01, 0.1, 1};

TEST(HistogramTest, CountsUpToEachBound) {
  Histogram histogram(kBounds);
  for (const double seconds : {0.001, 0.01, 0.05, 0.1, 0.5, 2.0, -1.0}) {
    histogram.Add(absl::Seconds(seconds));
  }
  const Histogram::Counts counts = histogram.Read();
  EXPECT_THAT(counts.up_to, ::testing::ElementsAre(3, 5, 6, 7)) << "a bound belongs to its bucket";
  EXPECT_NEAR(counts.sum_seconds, 2.661, 1e-9);
}

TEST(HistogramTest, LosesNothingOfConcurrentCalls) {
  Histogram histogram(kBounds);
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&histogram] {
      for (int j = 0; j < 10'000; ++j) histogram.Add(absl::Milliseconds(20));
    });
  }
  for (std::thread& thread : threads) thread.join();
  const Histogram::Counts counts = histogram.Read();
  EXPECT_THAT(counts.up_to, ::testing::ElementsAre(0, 40'000, 40'000, 40'000));
  EXPECT_NEAR(counts.sum_seconds, 800, 1e-6);
}

}  // namespace
}  // namespace sheaf::coordinator
