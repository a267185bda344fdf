// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The accounts of the job store: they agree with the parts, and outlive their jobs.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/check.h"
#include "common/base/digest.h"
#include "coordinator/store/tests/test_databases.h"

namespace sheaf::coordinator {
namespace {

class UsageStoreTest : public JobStoreFixture {
 protected:
  uint64_t CreateJob(const std::string& owner, const std::string& show, bool pilot = false) {
    JobSpec spec;
    spec.owner = owner;
    spec.show = show;
    spec.pilot = pilot;
    spec.frames.resize(1);
    spec.frames[0].frame_number = 7;
    spec.frames[0].scene = {Sha256Hex("scene"), 1};
    spec.frames[0].frame_digest = Sha256Hex("frame");
    const auto job =
        store_->CreateJob(spec, absl::StrCat("request", requests_++), absl::FromUnixSeconds(100));
    SHEAF_CHECK(job.ok());
    return job->job_id;
  }
  absl::Status WritePart(uint64_t job, uint64_t first) {
    PartRow row;
    row.key = {{job, 7}, {0, 0, 16, 16}, {first, 16}};
    row.digest = {Sha256Hex("bytes"), 5};
    row.worker_id = row.identity = "w";
    row.cost = {.ray_count = 100, .cpu_duration = absl::Seconds(2), .part_bytes = 5};
    row.sample_count = 4096;
    return store_->WritePart(row, "bytes");
  }
  std::vector<UsageRow> Rows(const UsageQuery& query = {}) {
    auto rows = store_->LoadUsage(query);
    SHEAF_CHECK(rows.ok());
    return *std::move(rows);
  }

  int requests_ = 0;
};

TEST_P(UsageStoreTest, PartsAreAccountedForWithTheirRows) {
  const uint64_t job = CreateJob("anna", "film");
  std::vector<std::thread> calls;
  for (uint64_t i = 0; i < 8; ++i) {
    calls.emplace_back([&, i] { EXPECT_TRUE(WritePart(job, 16 * i).ok()); });
  }
  for (std::thread& call : calls) call.join();
  EXPECT_TRUE(absl::IsAlreadyExists(WritePart(job, 0))) << "a duplicate does not count as work";
  Reopen();
  const std::vector<UsageRow> rows = Rows();
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_LE(UsageDayOf(absl::Now()) - rows[0].day, 1);
  EXPECT_EQ(rows[0].owner, "anna");
  EXPECT_EQ(rows[0].show, "film");
  EXPECT_EQ(rows[0].job_id, job);
  const Usage expected = {.result_count = 8,
                          .sample_count = 8 * 4096,
                          .ray_count = 800,
                          .cpu_duration = absl::Seconds(16),
                          .part_bytes = 40};
  EXPECT_EQ(rows[0].usage, expected);
}

TEST_P(UsageStoreTest, AccountsOutliveTheirJob) {
  const uint64_t job = CreateJob("anna", "film");
  ASSERT_TRUE(WritePart(job, 0).ok());
  const auto path = store_->OutputPath({job, 7});
  ASSERT_TRUE(path.ok());
  std::ofstream(*path) << "an image";
  ASSERT_TRUE(store_->DeliverFrame({job, 7}, {}).ok());
  ASSERT_TRUE(store_->EndJob(job, JobPhase::kSucceeded, "", absl::FromUnixSeconds(200), {}).ok());
  ASSERT_TRUE(store_->RemoveJob(job).ok());
  Reopen();
  const std::vector<UsageRow> rows = Rows();
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0].usage.image_bytes, 8u);
  EXPECT_EQ(rows[0].usage.cpu_duration, absl::Seconds(2));
  EXPECT_EQ(rows[0].show, "film");
}

TEST_P(UsageStoreTest, NotesAreWrittenTogether) {
  const uint64_t job = CreateJob("anna", "film");
  ASSERT_TRUE(WritePart(job, 0).ok());
  for (int i = 0; i < 3; ++i) {
    store_->NoteUsage({job}, {.lost_count = 1, .lost_cpu_duration = absl::Seconds(1)});
    store_->NoteUsage({0, "ben"}, {.upload_bytes = 10});
  }
  store_->NoteUsage({job + 1}, {.lost_count = 1});  // This job does not exist.
  ASSERT_TRUE(store_->WriteUsage().ok());
  Reopen();
  const std::vector<UsageRow> rows = Rows();
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[0].usage.lost_cpu_duration, absl::Seconds(3));
  EXPECT_EQ(rows[0].usage.result_count, 1u);
  EXPECT_EQ(rows[1].owner, "ben");
  EXPECT_EQ(rows[1].job_id, 0u);
  EXPECT_EQ(rows[1].usage.upload_bytes, 30u);
  EXPECT_EQ(Rows({.owner = "ben"}).size(), 1u);
  EXPECT_TRUE(Rows({.since_day = UsageDayOf(absl::Now()) + 1}).empty());
}

TEST_P(UsageStoreTest, PilotsShareARow) {
  const uint64_t one = CreateJob("anna", "", /*pilot=*/true);
  const uint64_t other = CreateJob("anna", "", /*pilot=*/true);
  ASSERT_NE(one, other);
  ASSERT_TRUE(WritePart(one, 0).ok());
  ASSERT_TRUE(WritePart(other, 0).ok());
  const std::vector<UsageRow> rows = Rows();
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0].job_id, kFirstPilotId);
  EXPECT_EQ(rows[0].usage.result_count, 2u);
}

TEST_P(UsageStoreTest, OldRowsGo) {
  CreateJob("anna", "film");
  store_->NoteUsage({0, "anna"}, {.upload_bytes = 1});
  ASSERT_TRUE(store_->WriteUsage().ok());
  store_.reset();
  Execute(absl::StrCat("UPDATE usage SET day = day - ", kUsageDaysKept + 1));
  Reopen();
  EXPECT_EQ(Rows().size(), 1u) << "until something is written";
  store_->NoteUsage({0, "anna"}, {.upload_bytes = 2});
  const std::vector<UsageRow> rows = Rows();
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0].usage.upload_bytes, 2u);
}

SHEAF_ON_ALL_DATABASES(UsageStoreTest);

}  // namespace
}  // namespace sheaf::coordinator
