// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Weights and limits, and the shows and requirements of jobs, in the job store.
#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "common/base/digest.h"
#include "coordinator/store/sqlite_job_store.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

TEST(SqliteSharesTest, SettingsAndRequirementsSurviveAReopen) {
  const std::string directory = testing::TempDir() + "sheaf-shares";
  std::filesystem::remove_all(directory);
  const ShareSubject user{ShareKind::kUser, "anna"}, show{ShareKind::kShow, "anna"};
  const ShareSetting setting{2.5, 64};
  JobSpec spec;
  spec.show = "comet";
  spec.deadline = {absl::FromUnixSeconds(1'700'000'000), 90, 80, 110};
  spec.requirements = {"big", {"avx", "ssd"}, uint64_t{1} << 34, 12345};
  spec.frames.resize(1);
  spec.frames[0].scene = {Sha256Hex("scene"), 1};
  spec.frames[0].frame_digest = Sha256Hex("frame");
  {
    auto store = SqliteJobStore::Open(directory);
    ASSERT_TRUE(store.ok()) << store.status();
    ASSERT_TRUE((*store)->WriteShare(user, {1, 1}).ok());
    ASSERT_TRUE((*store)->WriteShare(user, setting).ok());
    ASSERT_TRUE((*store)->WriteShare(show, {1, 3}).ok());
    ASSERT_TRUE((*store)->RemoveShare(show).ok());
    ASSERT_TRUE((*store)->RemoveShare({ShareKind::kPool, "none"}).ok());
    ASSERT_TRUE((*store)->CreateJob(spec, "request", absl::FromUnixSeconds(1)).ok());
  }
  auto store = SqliteJobStore::Open(directory);
  ASSERT_TRUE(store.ok()) << store.status();
  EXPECT_EQ(*(*store)->LoadShares(), (std::map<ShareSubject, ShareSetting>{{user, setting}}));
  const auto jobs = (*store)->LoadJobs();
  ASSERT_TRUE(jobs.ok() && jobs->size() == 1);
  EXPECT_EQ((*jobs)[0].damage, "");
  EXPECT_EQ((*jobs)[0].spec.show, "comet");
  EXPECT_EQ((*jobs)[0].spec.deadline, spec.deadline);
  EXPECT_EQ((*jobs)[0].spec.requirements, spec.requirements);
  store->reset();
  std::filesystem::remove_all(directory);
}

}  // namespace
}  // namespace sheaf::coordinator
