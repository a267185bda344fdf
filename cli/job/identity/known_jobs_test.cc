// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/identity/known_jobs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sheaf::cli {
namespace {

v1::Job MakeJob(const std::string& name, int64_t seconds, int32_t nanos) {
  v1::Job job;
  job.set_name(name);
  job.mutable_create_time()->set_seconds(seconds);
  job.mutable_create_time()->set_nanos(nanos);
  return job;
}

TEST(KnownJobsTest, ANumberIsNotAJob) {
  KnownJobs known;
  EXPECT_TRUE(known.Check(MakeJob("jobs/1", 100, 5)).ok());
  EXPECT_TRUE(known.Check(MakeJob("jobs/1", 100, 5)).ok());
  EXPECT_TRUE(known.Check(MakeJob("jobs/2", 100, 6)).ok());
  const absl::Status other = known.Check(MakeJob("jobs/1", 100, 6));
  EXPECT_TRUE(absl::IsNotFound(other));
  EXPECT_THAT(std::string(other.message()), ::testing::HasSubstr("another job"));
  EXPECT_FALSE(known.Check(MakeJob("jobs/1", 101, 5)).ok());
  known.Note(MakeJob("jobs/1", 200, 0));  // This client's own, after the state was replaced.
  EXPECT_TRUE(known.Check(MakeJob("jobs/1", 200, 0)).ok());
  EXPECT_TRUE(known.Has("jobs/2"));
  EXPECT_FALSE(known.Has("jobs/3"));
}

}  // namespace
}  // namespace sheaf::cli
