// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Databases that are damaged before a start or during use must produce errors that say what to do,
// and never end the process.
#include <atomic>
#include <filesystem>
#include <fstream>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/base/digest.h"
#include "coordinator/store/database/sqlite_database.h"
#include "coordinator/store/sql_job_store.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

class DamageTest : public ::testing::Test {
 protected:
  DamageTest()
      : directory_(::testing::TempDir() + "sheaf-damage-" +
                   ::testing::UnitTest::GetInstance()->current_test_info()->name()),
        database_(directory_ + "/farm.db") {
    std::filesystem::remove_all(directory_);
    auto store = SqlJobStore::Open(directory_, Durability::kProcess);
    SHEAF_CHECK(store.ok());
    store_ = std::move(*store);
    JobSpec job;
    job.title = "job";
    for (int32_t number = 1; number <= 200; ++number) {
      FrameSpec& frame = job.frames.emplace_back();
      frame.frame_number = number;
      frame.scene = {std::string(64, 'a'), 1};
      frame.frame_digest = Sha256Hex(absl::StrCat(number));
    }
    SHEAF_CHECK(store_->CreateJob(job, "request", absl::UnixEpoch()).ok());
    for (int32_t x = 0; x < 8; ++x) SHEAF_CHECK(WritePart(x).ok());
  }
  ~DamageTest() override {
    store_.reset();
    std::filesystem::remove_all(directory_);
  }
  static PartRow RowAt(int32_t x) {
    return {{{1, 1}, {x, 0, x + 1, 1}, {0, 16}, {}}, {Sha256Hex("bytes"), 5}, "w", {}};
  }
  absl::Status WritePart(int32_t x) { return store_->WritePart(RowAt(x), "bytes"); }
  bool HasPart(int32_t x) {
    const auto found = store_->FindPart(RowAt(x).key);
    return found.ok() && found->has_value();
  }
  // Reads everything that a start reads.
  absl::Status Start() {
    store_.reset();
    auto store = SqlJobStore::Open(directory_, Durability::kProcess);
    if (!store.ok()) return store.status();
    store_ = std::move(*store);
    const auto jobs = store_->LoadJobs();
    if (!jobs.ok()) return jobs.status();
    for (const StoredJob& job : *jobs) {
      if (auto parts = store_->LoadParts(job.spec.job_id); !parts.ok()) return parts.status();
    }
    return absl::OkStatus();
  }

  // Changes values as bits that flip on disk do: SQLite's checks do not see it.
  void Change(const std::string& statement) {
    store_.reset();
    auto changed = SqliteDatabase::Open(database_);
    SHEAF_CHECK(changed.ok() && (*changed)->Execute(statement).ok());
  }
  // The damage that LoadJobs reports after a start.
  std::string DamageAfterStart() {
    SHEAF_CHECK(Start().ok());
    const auto jobs = store_->LoadJobs();
    SHEAF_CHECK(jobs.ok() && jobs->size() == 1);
    return jobs->front().damage;
  }

  const std::string directory_, database_;
  std::unique_ptr<SqlJobStore> store_;
};

TEST_F(DamageTest, StatementErrorsFailTheCall) {
  ASSERT_TRUE((*SqliteDatabase::Open(database_))->Execute("DROP TABLE parts").ok());
  EXPECT_EQ(store_->FindPart(RowAt(0).key).status().code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(WritePart(9).code(), absl::StatusCode::kUnavailable);
  EXPECT_FALSE(store_->LoadParts(1).ok());
  EXPECT_FALSE(store_->RemoveFrameParts({1, 1}).ok());
  EXPECT_FALSE(store_->OldestDeliveredWithParts().ok());
  EXPECT_TRUE(store_->LoadJobs().ok());
}

// A statement that fails for lack of space may end the transaction that several calls share.
TEST_F(DamageTest, FailedCommitsStoreNothing) {
  ASSERT_TRUE((*SqliteDatabase::Open(database_))
                  ->Execute("CREATE TRIGGER full BEFORE INSERT ON parts WHEN NEW.x0 % 7 = 0 "
                            "BEGIN SELECT RAISE(ROLLBACK, 'the disk is full'); END;")
                  .ok());
  constexpr int32_t kFirst = 100, kThreads = 12, kEach = 20;
  std::vector<std::thread> threads;
  std::atomic<int> wrong = 0, refused = 0;
  for (int32_t thread = 0; thread < kThreads; ++thread) {
    threads.emplace_back([&, thread] {
      for (int32_t i = 0; i < kEach; ++i) {
        const int32_t x = kFirst + thread * kEach + i;
        const bool written = WritePart(x).ok();
        if (!written) ++refused;
        if (written != HasPart(x)) ++wrong;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_GE(refused, kThreads * kEach / 7);
  EXPECT_EQ(wrong, 0);
}

TEST_F(DamageTest, TruncatedDatabasesAreRefusedWithARemedy) {
  store_.reset();
  const auto size = std::filesystem::file_size(database_);
  for (const uintmax_t left : {size - 4096, size / 2, uintmax_t{4096}, uintmax_t{100}}) {
    std::filesystem::resize_file(database_, left);
    const absl::Status status = Start();
    EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss) << left << ": " << status;
    const std::string text(status.message());
    EXPECT_THAT(text, HasSubstr(database_));
    EXPECT_THAT(text, HasSubstr("sqlite3 " + database_ + " .recover"));
    EXPECT_THAT(text, HasSubstr("backup"));
  }
}

TEST_F(DamageTest, EmptiedDatabasesAreNotRecreated) {
  store_.reset();
  std::filesystem::resize_file(database_, 0);
  EXPECT_EQ(Start().code(), absl::StatusCode::kDataLoss);
  EXPECT_EQ(std::filesystem::file_size(database_), 0u);
  std::filesystem::remove(database_);  // Only an operator may decide to start over.
  EXPECT_TRUE(Start().ok());
}

TEST_F(DamageTest, ChangedNamesOfColumnsAreRefusedWithARemedy) {
  ASSERT_TRUE(
      (*SqliteDatabase::Open(database_))->Execute("ALTER TABLE parts RENAME seal TO rea1").ok());
  store_.reset();
  const absl::Status status = Start();
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("parts.rea1 is unknown"));
  EXPECT_THAT(std::string(status.message()), HasSubstr("backup"));
}

TEST_F(DamageTest, CorruptDatabasesNeverCrash) {
  store_.reset();
  std::ifstream file(database_, std::ios::binary);
  const std::string whole((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  std::mt19937 random(7);
  int refused = 0;
  for (int round = 0; round < 60; ++round) {
    std::string garbled = whole;
    for (int i = 0; i < 1 + round; ++i) {
      garbled[random() % garbled.size()] = static_cast<char>(random());
    }
    std::filesystem::remove(database_ + "-wal");
    std::filesystem::remove(database_ + "-shm");
    std::ofstream(database_, std::ios::binary) << garbled;
    const absl::Status status = Start();
    store_.reset();
    if (status.ok()) continue;
    ++refused;
    EXPECT_THAT(std::string(status.message()), HasSubstr("farm.db")) << round;
  }
  EXPECT_GT(refused, 20);
}

TEST_F(DamageTest, WholeRowsAreNotDamaged) { EXPECT_EQ(DamageAfterStart(), ""); }

TEST_F(DamageTest, SettingsThatChangeAreFound) {
  for (const char* change :
       {"seed = seed + 4", "samples = samples + 1", "max_depth = 7", "techniques = 1", "x0 = 1",
        "target_error = 0.5", "frame_digest = 'a' || substr(frame_digest, 2)",
        "scene_sha256 = 'none'"}) {
    SCOPED_TRACE(change);
    const auto whole = SqliteDatabase::Open(database_);
    ASSERT_TRUE(whole.ok());
    ASSERT_TRUE((*whole)->Execute("CREATE TEMP TABLE kept AS SELECT * FROM frames").ok());
    Change(absl::StrCat("UPDATE frames SET ", change, " WHERE frame_number = 7"));
    EXPECT_EQ(DamageAfterStart(), "the row of frame 7");
    ASSERT_TRUE(
        (*whole)->Execute("DELETE FROM frames; INSERT INTO frames SELECT * FROM kept").ok());
  }
  Change("UPDATE jobs SET tile_size_px = 16");
  EXPECT_EQ(DamageAfterStart(), "the job's row");
}

TEST_F(DamageTest, StatesThatChangeAreFound) {
  for (const char* change : {"paused = 1", "phase = 2", "priority = 64", "pinned = 1"}) {
    SCOPED_TRACE(change);
    ASSERT_TRUE(Start().ok());
    ASSERT_TRUE(store_->ChangeJob(1, {.paused = false}).ok());  // Seals the job as it is.
    EXPECT_EQ(DamageAfterStart(), "");
    Change(absl::StrCat("UPDATE jobs SET ", change));
    EXPECT_EQ(DamageAfterStart(), "the job's state");
  }
}

TEST_F(DamageTest, StatesThatAreChangedOnPurposeAreNotDamaged) {
  ASSERT_TRUE(store_->ChangeJob(1, {.paused = true}).ok());
  ASSERT_TRUE(store_->ChangeJob(1, {.priority = 7}).ok());
  ASSERT_TRUE(store_->ChangeJob(1, {.pinned = true}).ok());
  EXPECT_EQ(DamageAfterStart(), "");
  ASSERT_TRUE(store_->EndJob(1, JobPhase::kSucceeded, "", absl::Now(), absl::Seconds(1)).ok());
  ASSERT_TRUE(store_->ChangeJob(1, {.parts_removed_time = absl::Now()}).ok());
  EXPECT_EQ(DamageAfterStart(), "");
  auto jobs = store_->LoadJobs();
  ASSERT_TRUE(jobs.ok());
  ASSERT_TRUE(store_->ReopenJob(1, {{jobs->front().spec.frames[6], {}}}).ok());
  EXPECT_EQ(DamageAfterStart(), "");
}

TEST_F(DamageTest, RowsOfEarlierVersionsHaveNoSeals) {
  Change(
      "UPDATE frames SET seed = 4, seal = 0 WHERE frame_number = 7; "
      "UPDATE jobs SET seal = 0, state_seal = 0, paused = 1");
  EXPECT_EQ(DamageAfterStart(), "");
}

// The samples and the stop rule of a frame that continues are sealed again.
TEST_F(DamageTest, ReopenedFramesAreNotDamaged) {
  auto jobs = store_->LoadJobs();
  ASSERT_TRUE(jobs.ok());
  JobStore::ReopenedFrame reopened{jobs->front().spec.frames[6], {}};
  reopened.spec.settings.samples = 1 << 10;
  reopened.spec.stop.target_error = 0.01;
  ASSERT_TRUE(store_->ReopenJob(1, {reopened}).ok());
  EXPECT_EQ(DamageAfterStart(), "");
}

TEST_F(DamageTest, PartsWhoseRowsChangeAreLost) {
  Change("UPDATE parts SET cells = 2 WHERE x0 = 3; UPDATE parts SET cpu_ns = 5 WHERE x0 = 4");
  ASSERT_TRUE(Start().ok());
  EXPECT_FALSE(HasPart(3));
  EXPECT_FALSE(HasPart(4));
  EXPECT_TRUE(HasPart(5));
  const auto parts = store_->LoadParts(1);
  ASSERT_TRUE(parts.ok());
  EXPECT_EQ(parts->rows.size(), 6u);
  ASSERT_EQ(parts->lost.size(), 2u);
  for (const PartRow& row : parts->lost) EXPECT_TRUE(store_->RemovePart(row).ok());
  EXPECT_TRUE(store_->LoadParts(1)->lost.empty());
  EXPECT_EQ(store_->PartsBytes(), 6 * RowAt(0).digest.size_bytes);
}

TEST_F(DamageTest, LostPartsWhoseRowsCannotBeRemovedAreLoaded) {
  ASSERT_TRUE((*SqliteDatabase::Open(database_))
                  ->Execute("CREATE TRIGGER full BEFORE DELETE ON parts "
                            "BEGIN SELECT RAISE(ABORT, 'the disk is full'); END")
                  .ok());
  std::filesystem::remove(store_->PartPath(RowAt(3)));
  ASSERT_TRUE(Start().ok());
  const auto parts = store_->LoadParts(1);
  ASSERT_TRUE(parts.ok()) << parts.status();
  EXPECT_EQ(parts->rows.size(), 7u);
  ASSERT_EQ(parts->lost.size(), 1u);
  EXPECT_EQ(store_->RemovePart(parts->lost[0]).code(), absl::StatusCode::kUnavailable);
}

TEST_F(DamageTest, RoundsThatChangeAreRefusedWithARemedy) {
  RoundRecord round;
  round.cells.resize(2);
  ASSERT_TRUE(store_->AddRound({1, 7}, round).ok());
  EXPECT_TRUE(store_->LoadRounds(1, /*with_cells=*/true).ok());
  Change("UPDATE rounds SET tiles = zeroblob(120)");
  ASSERT_TRUE(Start().ok());
  const absl::Status status = store_->LoadRounds(1, /*with_cells=*/true).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(status.message()), HasSubstr("backup"));
}

// A byte changes in the log after a kill: the parts whose rows SQLite drops are reported as lost,
// and lease ids of runs that may be lost are not reused.
TEST_F(DamageTest, PartsWhoseCommitsAreLostAreCounted) {
  ASSERT_TRUE(WritePart(100).ok());
  const auto log_bytes = std::filesystem::file_size(database_ + "-wal");
  for (int32_t x = 101; x < 105; ++x) ASSERT_TRUE(WritePart(x).ok());
  const uint64_t lease_id = store_->FirstLeaseId();
  const std::string killed = directory_ + "-killed";
  std::filesystem::remove_all(killed);
  std::filesystem::copy(directory_, killed, std::filesystem::copy_options::recursive);
  store_.reset();
  std::filesystem::remove_all(directory_);
  std::filesystem::rename(killed, directory_);
  std::filesystem::remove(database_ + "-shm");
  std::fstream log(database_ + "-wal", std::ios::in | std::ios::out | std::ios::binary);
  log.seekp(static_cast<std::streamoff>(log_bytes) + 1000);
  log.put('\x5a');
  log.close();

  auto store = SqlJobStore::Open(directory_, Durability::kProcess);
  ASSERT_TRUE(store.ok()) << store.status();
  store_ = std::move(*store);
  EXPECT_EQ(store_->LostCommits(), 4);
  EXPECT_GE(store_->FirstLeaseId(), lease_id + (uint64_t{5} << 40));
  const auto parts = store_->LoadParts(1);
  ASSERT_TRUE(parts.ok());
  EXPECT_EQ(parts->rows.size(), 9u);
  EXPECT_TRUE(parts->lost.empty());
  EXPECT_EQ(parts->files_without_row, 4);
  EXPECT_TRUE(HasPart(100));
  EXPECT_FALSE(HasPart(101));
}

TEST_F(DamageTest, OtherFilesAreRefused) {
  store_.reset();
  std::ofstream(database_) << std::string(4096, 'x');
  const absl::Status status = SqlJobStore::Open(directory_).status();
  EXPECT_FALSE(status.ok());
  EXPECT_THAT(std::string(status.message()), HasSubstr("farm.db"));
}

}  // namespace
}  // namespace sheaf::coordinator
