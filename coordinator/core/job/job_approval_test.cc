// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/job/job_approval.h"

#include "coordinator/core/job/owner_work.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

JobSpec JobOf(uint64_t samples) {
  JobSpec job;
  for (const int32_t number : {3, 4}) {
    FrameSpec frame;
    frame.frame_number = number;
    frame.settings.window = {0, 0, 10, 10};
    frame.settings.samples = samples;
    job.frames.push_back(frame);
  }
  return job;
}

TEST(JobApprovalTest, FramesBeginWithTheFirstSamples) {
  JobSpec job = JobOf(100);
  ASSERT_TRUE(HoldForApproval(0, &job).ok());
  EXPECT_TRUE(job.approvals.empty());
  const OwnerWork before = WorkOf(job);
  ASSERT_TRUE(HoldForApproval(16, &job).ok());
  EXPECT_EQ(job.frames[1].settings.samples, 16u);
  EXPECT_EQ(job.approvals.at(4), (FrameApproval{100, false}));
  EXPECT_TRUE(IsUnapproved(job, 3));
  EXPECT_FALSE(IsUnapproved(job, 5)) << "there is no such frame";
  EXPECT_EQ(ApprovedFrames(job)[0].settings.samples, 100u);
  EXPECT_EQ(WorkOf(job), before) << "an owner has to have room for all of it";
  job.approvals.at(3).approved = true;
  EXPECT_FALSE(IsUnapproved(job, 3));
  EXPECT_EQ(ApprovedFrames(job)[0].settings.samples, 16u) << "it has what it gets";
}

TEST(JobApprovalTest, FramesThatCannotWaitAreRefused) {
  const auto refusal = [](uint64_t samples, JobSpec job) {
    const absl::Status status = HoldForApproval(samples, &job);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    return std::string(status.message());
  };
  EXPECT_THAT(refusal(12, JobOf(100)), HasSubstr("not a power of two; choose 8"));
  EXPECT_THAT(refusal(64, JobOf(64)), HasSubstr("frame 3 has 64 samples in all"));
  JobSpec job = JobOf(100);
  job.frames[1].stop.target_error = 0.1;
  EXPECT_THAT(refusal(16, job), HasSubstr("frame 4 is ended by a target error"));
  job = JobOf(100);
  job.frames[0].resumed.sha256_hex = "a";
  EXPECT_THAT(refusal(16, job), HasSubstr("resumes an image"));
  job = JobOf(100);
  job.pilot = true;
  EXPECT_THAT(refusal(16, job), HasSubstr("pilots"));
}

}  // namespace
}  // namespace sheaf::coordinator
