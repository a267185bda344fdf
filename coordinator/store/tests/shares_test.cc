// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Weights and limits, and the shows, deadlines and requirements of jobs, in the job store.
#include <map>
#include <string>

#include "common/base/digest.h"
#include "coordinator/store/tests/test_databases.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

class SharesTest : public JobStoreFixture {};

TEST_P(SharesTest, SettingsAndRequirementsSurviveAReopen) {
  const ShareSubject user{ShareKind::kUser, "anna"}, show{ShareKind::kShow, "anna"};
  const ShareSetting setting{2.5, 64};
  JobSpec spec;
  spec.show = "comet";
  spec.deadline = {absl::FromUnixSeconds(1'700'000'000), 90, 80, 110};
  spec.requirements = {"big", {"avx", "ssd"}, uint64_t{1} << 34, 12345};
  spec.frames.resize(1);
  spec.frames[0].scene = {Sha256Hex("scene"), 1};
  spec.frames[0].frame_digest = Sha256Hex("frame");
  ASSERT_TRUE(store_->WriteShare(user, {1, 1}).ok());
  ASSERT_TRUE(store_->WriteShare(user, setting).ok());
  ASSERT_TRUE(store_->WriteShare(show, {1, 3}).ok());
  ASSERT_TRUE(store_->RemoveShare(show).ok());
  ASSERT_TRUE(store_->RemoveShare({ShareKind::kPool, "none"}).ok());
  ASSERT_TRUE(store_->CreateJob(spec, "request", absl::FromUnixSeconds(1)).ok());
  Reopen();
  EXPECT_EQ(*store_->LoadShares(), (std::map<ShareSubject, ShareSetting>{{user, setting}}));
  const auto jobs = store_->LoadJobs();
  ASSERT_TRUE(jobs.ok() && jobs->size() == 1);
  EXPECT_EQ((*jobs)[0].damage, "");
  EXPECT_EQ((*jobs)[0].spec.show, "comet");
  EXPECT_EQ((*jobs)[0].spec.deadline, spec.deadline);
  EXPECT_EQ((*jobs)[0].spec.requirements, spec.requirements);
}

SHEAF_ON_ALL_DATABASES(SharesTest);

}  // namespace
}  // namespace sheaf::coordinator
