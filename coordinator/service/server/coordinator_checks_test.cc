// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// False results over the wire: a worker that sends plausible sums that it did not render. They are
// detected by rendering again, removed and corrected, also in delivered frames.
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "coordinator/store/sql_job_store.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/support/farm/coordinator_server_fixture.h"

namespace sheaf::coordinator {
namespace {

using Response = v1::UploadResultsResponse;
using ::testing::HasSubstr;

class CoordinatorChecksTest : public CoordinatorServerTest {
 protected:
  CoordinatorChecksTest() { options_.farm.limits.check_fraction = 1; }
  SyntheticWorker MakeLiar(const std::string& id) {
    SyntheticWorker liar = MakeWorker(id);
    liar.set_falsify([](FilmTile* part) { ScaleColors(1.02F, part); });
    return liar;
  }
  // Has the workers render in turns until the job has ended and its image has these samples.
  v1::Job Finish(const std::string& name, std::vector<SyntheticWorker*> workers) {
    const absl::Time deadline = absl::Now() + kPatience;
    while (absl::Now() < deadline) {
      for (SyntheticWorker* worker : workers) worker->RenderAll().status().IgnoreError();
      const v1::Job job = Get(name);
      if (job.state() == v1::Job::STATE_SUCCEEDED) return job;
      absl::SleepFor(absl::Milliseconds(10));
    }
    return Get(name);
  }
};

TEST_F(CoordinatorChecksTest, HonestResultsPass) {
  Start();
  const std::string name = Create(Request(64)).name();
  SyntheticWorker a = MakeWorker("a"), b = MakeWorker("b");
  ASSERT_TRUE(b.Synchronize(0).ok());
  const v1::Job after = Finish(name, {&a, &b});
  EXPECT_EQ(after.frames(0).image_digest(), ExpectedDigest(64));
  EXPECT_GT(Counter("sheaf_checks_begun_total"), 0);
  EXPECT_EQ(Counter("sheaf_checks_dropped_total"), 0);
  EXPECT_EQ(Counter("sheaf_samples_checked_total"), Counter("sheaf_samples_accepted_total"));
  EXPECT_EQ(Counter("sheaf_workers_quarantined_total"), 0);
  EXPECT_EQ(after.warning(), "");
}

TEST_F(CoordinatorChecksTest, FalseResultsThatCameFirstAreRemoved) {
  Start();
  const std::string name = Create(Request(64)).name();
  SyntheticWorker liar = MakeLiar("liar"), b = MakeWorker("b"), c = MakeWorker("c");
  ASSERT_TRUE(b.Synchronize(0).ok());
  ASSERT_TRUE(c.Synchronize(0).ok());
  ASSERT_TRUE(liar.Synchronize(2).ok());
  ASSERT_EQ(*liar.RenderOne(), Response::OUTCOME_ACCEPTED);
  ASSERT_EQ(*liar.RenderOne(), Response::OUTCOME_ACCEPTED);
  const v1::Job after = Finish(name, {&b, &c});
  EXPECT_EQ(after.frames(0).image_digest(), ExpectedDigest(64));
  EXPECT_EQ(after.frames(0).correction_count(), 0) << "the false image was not delivered";
  EXPECT_EQ(liar.Synchronize(1).code(), absl::StatusCode::kPermissionDenied);
  EXPECT_TRUE(b.Synchronize(1).ok());
  EXPECT_TRUE(c.Synchronize(1).ok());
}

TEST_F(CoordinatorChecksTest, DeliveredFramesAreCorrected) {
  Start();
  SyntheticWorker liar = MakeLiar("liar");
  const std::string name = Create(Request(64)).name();
  const v1::Job before = Finish(name, {&liar});  // It is the only worker.
  ASSERT_EQ(before.state(), v1::Job::STATE_SUCCEEDED);
  ASSERT_NE(before.frames(0).image_digest(), ExpectedDigest(64));
  // It is found in another job.
  const std::string other = Create(Request(16, "another")).name();
  SyntheticWorker b = MakeWorker("b"), c = MakeWorker("c");
  ASSERT_TRUE(b.Synchronize(0).ok());
  ASSERT_TRUE(c.Synchronize(0).ok());
  ASSERT_TRUE(liar.Synchronize(1).ok());
  ASSERT_EQ(*liar.RenderOne(), Response::OUTCOME_ACCEPTED);
  EXPECT_EQ(Finish(other, {&b, &c}).frames(0).image_digest(), ExpectedDigest(16));
  const absl::Time deadline = absl::Now() + kPatience;
  while (Get(name).frames(0).image_digest() != ExpectedDigest(64) && absl::Now() < deadline) {
    Finish(name, {&b, &c});
  }
  const v1::Job after = Get(name);
  EXPECT_EQ(after.state(), v1::Job::STATE_SUCCEEDED);
  EXPECT_EQ(after.frames(0).image_digest(), ExpectedDigest(64));
  EXPECT_EQ(after.frames(0).correction_count(), 1);
  EXPECT_THAT(after.warning(), HasSubstr("frame 1 corrected"));
  EXPECT_THAT(after.warning(), HasSubstr("liar"));
  Start();
  EXPECT_EQ(Get(name).frames(0).correction_count(), 1);
  EXPECT_EQ(Get(name).warning(), after.warning());
  EXPECT_EQ(Get(name).frames(0).image_digest(), ExpectedDigest(64));
}

// Rounds are decided again: their decisions came from false sums.
TEST_F(CoordinatorChecksTest, FramesInRoundsAreCorrected) {
  Start();
  v1::CreateJobRequest request = Request(256);
  request.mutable_frames(0)->mutable_stop()->set_target_error(1e-9);
  SyntheticWorker b = MakeWorker("b"), c = MakeWorker("c"), liar = MakeLiar("liar");
  const std::string honest = Finish(Create(request).name(), {&b}).frames(0).image_digest();
  request.set_request_id("second");
  request.mutable_frames(0)->mutable_settings()->set_seed(0);
  const std::string name = Create(request).name();
  ASSERT_TRUE(c.Synchronize(0).ok());
  ASSERT_TRUE(liar.Synchronize(4).ok());
  while (!liar.leases().empty()) ASSERT_TRUE(liar.RenderOne().ok());
  EXPECT_EQ(Finish(name, {&b, &c}).frames(0).image_digest(), honest);
}

TEST_F(CoordinatorChecksTest, TwoThatDifferAreADispute) {
  options_.farm.limits.check_wait_max = absl::Milliseconds(100);
  Start();
  const std::string name = Create(Request(16)).name();
  SyntheticWorker liar = MakeLiar("liar"), b = MakeWorker("b");
  ASSERT_TRUE(b.Synchronize(0).ok());
  const v1::Job after = Finish(name, {&liar, &b});
  EXPECT_EQ(after.state(), v1::Job::STATE_SUCCEEDED);
  EXPECT_THAT(after.warning(), HasSubstr("disputed"));
  EXPECT_EQ(Counter("sheaf_workers_quarantined_total"), 0) << "it is unknown who is right";
}

TEST_F(CoordinatorChecksTest, ACorrectionThatWasInterruptedIsDoneAtTheNextStart) {
  Start();
  SyntheticWorker liar = MakeLiar("liar");
  const std::string name = Create(Request(64)).name();
  ASSERT_EQ(Finish(name, {&liar}).state(), v1::Job::STATE_SUCCEEDED);
  server_.reset();
  {
    const auto store = SqlJobStore::Open(directory_);
    ASSERT_TRUE(store.ok());
    ASSERT_TRUE((*store)->WriteQuarantine({"liar", "it lied", true, absl::Now()}).ok());
  }
  Start();
  SyntheticWorker b = MakeWorker("b");
  const absl::Time deadline = absl::Now() + kPatience;
  while (Get(name).frames(0).image_digest() != ExpectedDigest(64) && absl::Now() < deadline) {
    Finish(name, {&b});
  }
  EXPECT_EQ(Get(name).frames(0).image_digest(), ExpectedDigest(64));
  EXPECT_EQ(Get(name).frames(0).correction_count(), 1);
}

}  // namespace
}  // namespace sheaf::coordinator
