// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/retry_after.h"

#include "gtest/gtest.h"

namespace sheaf {
namespace {

TEST(RetryAfterTest, TheWaitIsInTheWords) {
  const absl::Status refused = RetryAfterError("too many calls", absl::Milliseconds(500));
  EXPECT_EQ(refused, absl::ResourceExhaustedError("too many calls; retry after 0.5 s"));
  EXPECT_EQ(RetryAfterOf(refused), absl::Milliseconds(500));
}

TEST(RetryAfterTest, OtherStatusesHaveNone) {
  EXPECT_EQ(RetryAfterOf(absl::OkStatus()), std::nullopt);
  EXPECT_EQ(RetryAfterOf(absl::UnavailableError("x; retry after 1 s")), std::nullopt);
  for (const char* text : {"the disk is full", "x; retry after 1", "; retry after s",
                           "x; retry after -1 s", "x; retry after nan s", "x; retry after 1e9 s"}) {
    EXPECT_EQ(RetryAfterOf(absl::ResourceExhaustedError(text)), std::nullopt) << text;
  }
}

}  // namespace
}  // namespace sheaf
