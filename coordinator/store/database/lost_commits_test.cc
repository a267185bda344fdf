// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Bytes that change in the log of a database after its process was killed: the commits that SQLite
// drops then are counted.
#include "coordinator/store/database/lost_commits.h"

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/base/file.h"
#include "coordinator/store/database/sqlite_database.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

constexpr int64_t kInserts = 6;
constexpr int64_t kHeaderBytes = 32, kFrameHeaderBytes = 24, kFrameBytes = 24 + 4096;
constexpr int64_t kSaltsAt = 8, kSumsAt = 16;
constexpr uint64_t kLogBytesMax = uint64_t{1} << 20;

class LostCommitsTest : public ::testing::Test {
 protected:
  LostCommitsTest()
      : directory_(::testing::TempDir() + "sheaf-log-" +
                   ::testing::UnitTest::GetInstance()->current_test_info()->name()),
        killed_(directory_ + "/killed.db") {
    std::filesystem::remove_all(directory_);
    std::filesystem::create_directory(directory_);
    database_ = *SqliteDatabase::Open(directory_ + "/live.db");
    Run("CREATE TABLE t(x INTEGER)");
    for (int64_t x = 0; x < kInserts; ++x) Run("INSERT INTO t VALUES(1)");
    Kill();
  }
  ~LostCommitsTest() override {
    database_.reset();
    std::filesystem::remove_all(directory_);
  }
  void Run(const std::string& sql) { SHEAF_CHECK(database_->Execute(sql).ok()); }
  // Copies the files as they are, which is what a process that is killed leaves.
  void Kill() {
    for (const std::string suffix : {"", "-wal"}) {
      std::filesystem::copy_file(directory_ + "/live.db" + suffix, killed_ + suffix,
                                 std::filesystem::copy_options::overwrite_existing);
    }
    std::filesystem::remove(killed_ + "-shm");
  }
  int64_t FrameCount() const {
    return (static_cast<int64_t>(std::filesystem::file_size(killed_ + "-wal")) - kHeaderBytes) /
           kFrameBytes;
  }
  void ChangeByte(int64_t at) {
    std::fstream log(killed_ + "-wal", std::ios::in | std::ios::out | std::ios::binary);
    log.seekg(at);
    const auto changed = static_cast<char>(log.get() ^ 0x10);
    log.seekp(at);
    log.put(changed);
    SHEAF_CHECK(log.good());
  }
  int64_t Count() const { return CountLostCommits(killed_ + "-wal"); }
  // The rows that a start finds.
  int64_t Rows() const {
    const auto started = SqliteDatabase::Open(killed_);
    Statement query = (*started)->Prepare("SELECT COUNT(*) FROM t");
    return query.Step().ok() ? query.Int64(0) : -1;
  }

  const std::string directory_, killed_;
  std::unique_ptr<SqliteDatabase> database_;
};

TEST_F(LostCommitsTest, AWholeLogLosesNone) {
  EXPECT_EQ(Count(), 0);
  EXPECT_EQ(Rows(), kInserts);
  EXPECT_EQ(CountLostCommits(directory_ + "/none.db-wal"), 0);
}

TEST_F(LostCommitsTest, CommitsFromAChangedByteOnAreCounted) {
  const int64_t frames = FrameCount();
  ASSERT_GT(frames, kInserts);  // One for each, and those of the table.
  for (int64_t insert = 0; insert < kInserts - 1; ++insert) {
    const int64_t frame = kHeaderBytes + (frames - kInserts + insert) * kFrameBytes;
    for (const int64_t place : {kSaltsAt, kSumsAt, kFrameHeaderBytes + 700}) {
      SCOPED_TRACE(absl::StrCat("insert ", insert, ", byte ", place));
      Kill();
      ChangeByte(frame + place);
      EXPECT_EQ(Count(), kInserts - insert);
      EXPECT_EQ(Rows(), insert) << "what SQLite makes of it";
    }
  }
}

TEST_F(LostCommitsTest, AChangedHeaderLosesAllOfTheLog) {
  ChangeByte(kSaltsAt);
  EXPECT_EQ(Count(), kInserts + 1);
}

// The write of a log's end may have been interrupted: it was not acknowledged.
TEST_F(LostCommitsTest, TheLastCommitMayNotHaveBeenWritten) {
  const int64_t last = kHeaderBytes + (FrameCount() - 1) * kFrameBytes;
  ChangeByte(last + kFrameHeaderBytes);
  EXPECT_EQ(Count(), 0);
  Kill();
  std::filesystem::resize_file(killed_ + "-wal", static_cast<uintmax_t>(last) + 100);
  EXPECT_EQ(Count(), 0);
}

// After a checkpoint the log is overwritten from its start; the bytes behind its end are old.
TEST_F(LostCommitsTest, OldFramesAreNotLost) {
  Run("PRAGMA wal_checkpoint(RESTART)");
  Run("INSERT INTO t VALUES(1)");
  Kill();
  ASSERT_GT(FrameCount(), kInserts);
  EXPECT_EQ(Count(), 0);
  EXPECT_EQ(Rows(), kInserts + 1);
}

// Transactions that fail when they are flushed leave their frames, which the next one overwrites in
// part: a small one leaves the end of a greater one, and that the end of one greater still.
TEST_F(LostCommitsTest, FailedTransactionsAreNotLost) {
  std::string log;
  for (const int64_t blob_bytes : {1, 12'000, 40'000}) {
    Kill();
    const auto started = SqliteDatabase::Open(killed_);
    const std::string sql = absl::StrCat("INSERT INTO t VALUES(zeroblob(", blob_bytes, "))");
    ASSERT_TRUE((*started)->Execute(sql).ok());
    const std::string longer = *ReadWholeFile(killed_ + "-wal", kLogBytesMax);
    ASSERT_GT(longer.size(), log.size());
    log += longer.substr(log.size());
  }
  Kill();
  std::ofstream(killed_ + "-wal", std::ios::binary) << log;
  EXPECT_EQ(Count(), 0);
  EXPECT_EQ(Rows(), kInserts + 1) << "the smallest was written last";
}

}  // namespace
}  // namespace sheaf::coordinator
