// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Removals from the job store, also when they stop in the middle.
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "common/base/check.h"
#include "common/base/digest.h"
#include "coordinator/store/tests/test_databases.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

namespace fs = std::filesystem;

class RetentionTest : public JobStoreFixture {
 protected:
  uint64_t CreateJob(const std::string& request_id, bool pilot = false) {
    JobSpec spec;
    spec.pilot = pilot;
    spec.frames.resize(1);
    FrameSpec& frame = spec.frames[0];
    frame.frame_number = 7;
    frame.scene = {Sha256Hex("scene"), 1};
    frame.frame_digest = Sha256Hex("frame");
    frame.settings.width_px = frame.settings.height_px = 16;
    frame.settings.window = {0, 0, 16, 16};
    return store_->CreateJob(spec, request_id, absl::FromUnixSeconds(100))->job_id;
  }
  // A job that has succeeded, with one part of 5 bytes and one image.
  uint64_t FinishedJob(const std::string& request_id) {
    const uint64_t job = CreateJob(request_id);
    WritePart(job);
    WriteFile(*store_->OutputPath({job, 7}), "image");
    SHEAF_CHECK(store_->DeliverFrame({job, 7}, {}).ok());
    SHEAF_CHECK(store_->EndJob(job, JobPhase::kSucceeded, "", absl::FromUnixSeconds(200), {}).ok());
    return job;
  }
  PartRow WritePart(uint64_t job) {
    PartRow row;
    row.key = {{job, 7}, {0, 0, 16, 16}, {0, 16}};
    row.digest = {Sha256Hex("bytes"), 5};
    row.worker_id = row.identity = "w";
    SHEAF_CHECK(store_->WritePart(row, "bytes").ok());
    return row;
  }
  static void WriteFile(const std::string& path, const std::string& text) {
    fs::create_directories(fs::path(path).parent_path());
    std::ofstream(path) << text;
  }
  bool Exists(const std::string& name) const { return fs::exists(directory_ + "/" + name); }
};

TEST_P(RetentionTest, PinsAndRemovedPartsSurviveAReopen) {
  const uint64_t job = FinishedJob("a");
  ASSERT_TRUE(store_->ChangeJob(job, {.pinned = true}).ok());
  ASSERT_TRUE(store_->ChangeJob(job, {.parts_removed_time = absl::FromUnixSeconds(300)}).ok());
  Reopen();
  auto jobs = store_->LoadJobs();
  ASSERT_TRUE(jobs.ok() && jobs->size() == 1);
  EXPECT_TRUE((*jobs)[0].pinned);
  EXPECT_EQ((*jobs)[0].parts_removed_time, absl::FromUnixSeconds(300));
  // A job that begins again will have parts again.
  FrameSpec spec = (*jobs)[0].spec.frames[0];
  spec.resumed = {Sha256Hex("image"), 5};
  ASSERT_TRUE(store_->ReopenJob(job, {{spec, {}}}).ok());
  ASSERT_TRUE(store_->ChangeJob(job, {.pinned = false}).ok());
  Reopen();
  jobs = store_->LoadJobs();
  ASSERT_TRUE(jobs.ok() && jobs->size() == 1);
  EXPECT_FALSE((*jobs)[0].pinned);
  EXPECT_EQ((*jobs)[0].parts_removed_time, absl::InfiniteFuture());
  EXPECT_EQ((*jobs)[0].spec.frames[0].resumed, spec.resumed);
  EXPECT_EQ((*jobs)[0].damage, "") << "the new image is under the frame's seal";
}

TEST_P(RetentionTest, PartsAreCountedByJob) {
  const uint64_t first = FinishedJob("a"), second = CreateJob("b");
  EXPECT_EQ(*store_->PartsBytesByJob(), (std::map<uint64_t, uint64_t>{{first, 5}}));
  WritePart(second);
  EXPECT_EQ(*store_->PartsBytesByJob(), (std::map<uint64_t, uint64_t>{{first, 5}, {second, 5}}));
}

TEST_P(RetentionTest, PartsOfPinnedJobsAreNotTheOldest) {
  const uint64_t first = FinishedJob("a"), second = FinishedJob("b");
  EXPECT_EQ((*store_->OldestDeliveredWithParts())->job_id, first);
  ASSERT_TRUE(store_->ChangeJob(first, {.pinned = true}).ok());
  EXPECT_EQ((*store_->OldestDeliveredWithParts())->job_id, second);
  ASSERT_TRUE(store_->ChangeJob(second, {.pinned = true}).ok());
  EXPECT_FALSE(store_->OldestDeliveredWithParts()->has_value());
}

TEST_P(RetentionTest, ARemovedJobLeavesNothing) {
  const uint64_t job = FinishedJob("a"), other = FinishedJob("b");
  const TaskTrouble killed{{job, 7}, TaskKind::kCamera, {}, {0, 0}, {}, {}, "killed by ann"};
  ASSERT_TRUE(store_->WriteTroubles({killed}).ok());
  ASSERT_TRUE(store_->RemoveJob(job).ok());
  EXPECT_TRUE(store_->LoadTroubles(job)->empty());
  EXPECT_EQ(store_->PartsBytes(), 5u);
  EXPECT_FALSE(Exists("parts/1"));
  EXPECT_FALSE(Exists("outputs/1"));
  EXPECT_TRUE(Exists("parts/2/7"));
  EXPECT_TRUE(Exists("outputs/2/7.exr"));
  EXPECT_FALSE(store_->FindRequest("a")->has_value());
  Reopen();
  const auto jobs = store_->LoadJobs();
  ASSERT_TRUE(jobs.ok() && jobs->size() == 1);
  EXPECT_EQ((*jobs)[0].spec.job_id, other);
  EXPECT_EQ(store_->LoadParts(other)->rows.size(), 1u);
}

TEST_P(RetentionTest, IdsOfRemovedJobsAreNotGivenAgain) {
  EXPECT_EQ(FinishedJob("a"), 1u);
  EXPECT_EQ(FinishedJob("b"), 2u);
  const uint64_t pilot = CreateJob("p", /*pilot=*/true);
  for (const uint64_t job : {uint64_t{2}, uint64_t{1}, pilot}) {
    ASSERT_TRUE(store_->RemoveJob(job).ok());
  }
  for (int life = 0; life < 3; ++life) Reopen();
  EXPECT_EQ(CreateJob("c"), 3u);
  EXPECT_EQ(CreateJob("q", /*pilot=*/true), pilot + 1);
}

// A stop after the rows are gone and before the files are.
TEST_P(RetentionTest, FilesThatAStopLeftOfARemovedJobGoAtTheNextStart) {
  FinishedJob("a");
  ASSERT_TRUE(store_->RemoveJob(1).ok());
  WriteFile(directory_ + "/outputs/1/7.exr", "image");
  WriteFile(directory_ + "/parts/1/7/part.exr", "bytes");
  // The images of an unknown job may be their only copies.
  WriteFile(directory_ + "/outputs/9/7.exr", "image");
  Reopen();
  EXPECT_FALSE(Exists("outputs/1"));
  EXPECT_FALSE(Exists("parts/1"));
  EXPECT_TRUE(Exists("outputs/9/7.exr"));
  EXPECT_EQ(CreateJob("b"), 10u);
}

TEST_P(RetentionTest, FoldersOfPartsWithoutRowsGoAtTheNextStart) {
  FinishedJob("a");
  FinishedJob("b");
  const uint64_t live = CreateJob("c");
  ASSERT_TRUE(store_->RemoveFrameParts({1, 7}).ok());
  WriteFile(directory_ + "/parts/1/7/part.exr", "bytes");
  WriteFile(directory_ + "/parts/3/7/part.exr", "bytes");
  Reopen();
  EXPECT_FALSE(Exists("parts/1"));
  EXPECT_EQ(store_->LoadParts(2)->rows.size(), 1u);
  EXPECT_EQ(store_->LoadParts(live)->files_without_row, 1) << "LoadParts counts those";
}

SHEAF_ON_ALL_DATABASES(RetentionTest);

}  // namespace
}  // namespace sheaf::coordinator
