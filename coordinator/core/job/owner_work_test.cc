// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/job/owner_work.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <string>

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

Limits Few() {
  Limits limits;
  limits.owner_jobs_max = 3;
  limits.owner_frames_max = 100;
  limits.owner_samples_max = 1'000'000;
  return limits;
}

TEST(OwnerWorkTest, AJobHoldsItsFramesAndTheirSamples) {
  JobSpec spec;
  spec.frames.resize(2);
  spec.frames[0].settings.window = {0, 0, 10, 20};
  spec.frames[0].settings.samples = 4;
  spec.frames[1].settings.window = {5, 5, 6, 6};
  spec.frames[1].settings.samples = 100;
  EXPECT_EQ(WorkOf(spec), (OwnerWork{1, 2, 900}));
}

TEST(CheckOwnerWorkTest, AllowsUpToTheLimit) {
  EXPECT_TRUE(CheckOwnerWork({2, 50, 0}, {1, 50, 1'000'000}, Few()).ok());
}

TEST(CheckOwnerWorkTest, NamesTheLimit) {
  const auto message = [](const OwnerWork& present, const OwnerWork& more) {
    const absl::Status status = CheckOwnerWork(present, more, Few());
    EXPECT_TRUE(absl::IsResourceExhausted(status)) << status;
    return std::string(status.message());
  };
  EXPECT_THAT(message({3, 0, 0}, {1, 1, 1}), HasSubstr("have 3 jobs; 1 more would exceed 3"));
  EXPECT_THAT(message({1, 60, 0}, {1, 41, 1}), HasSubstr("have 60 frames; 41 more"));
  EXPECT_THAT(message({1, 1, 999'999}, {1, 1, 2}), HasSubstr("999999 samples; 2 more"));
  EXPECT_THAT(message({1, 1, 2'000'000}, {1, 1, UINT64_MAX}), HasSubstr("samples"))
      << "beyond a limit that was lowered meanwhile, and without overflow";
}

}  // namespace
}  // namespace sheaf::coordinator
