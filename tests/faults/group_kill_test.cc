// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A store is killed (kill -9) while many threads write parts to it, at random moments, again and
// again on one directory. Each restart must find every acknowledged part, whole, and no file of a
// part without a row. tests/sim covers what a loss of power leaves of a group. SHEAF_KILLS is the
// number of kills, by default 5; SHEAF_SEED repeats a run.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/check.h"
#include "common/base/digest.h"
#include "coordinator/store/sql_job_store.h"

namespace sheaf::coordinator {
namespace {

constexpr int kWriters = 16;
constexpr size_t kPartBytes = 24 << 10;
constexpr absl::Duration kKillAfterMax = absl::Milliseconds(60);
constexpr uint32_t kPartsPerLifeMax = 1 << 20;
// A life that writes nothing would test nothing.
constexpr absl::Duration kFirstPartMax = absl::Seconds(60);

uint64_t NumberOf(const char* name, uint64_t otherwise) {
  const char* value = std::getenv(name);
  return value == nullptr ? otherwise : std::strtoull(value, nullptr, 10);
}

std::string BytesOf(uint32_t index) {
  std::string bytes(kPartBytes, '\0');
  std::mt19937 random(index);
  for (char& byte : bytes) byte = static_cast<char>(random());
  return bytes;
}

PartRow RowOf(uint64_t job, uint32_t index, const std::string& bytes) {
  PartRow row;
  row.key.frame = {job, 1};
  row.key.tile = {0, 0, 16, 16};
  row.key.block = {uint64_t{index} * 16, 16};
  row.digest = {Sha256Hex(bytes), bytes.size()};
  row.worker_id = "w";
  return row;
}

// The life that is killed: writes parts from `first` on, and tells of each that is acknowledged.
[[noreturn]] void WriteUntilKilled(const std::string& directory, uint64_t job, uint32_t first,
                                   int told) {
  absl::StatusOr<std::unique_ptr<SqlJobStore>> store = SqlJobStore::Open(directory);
  if (!store.ok()) ::_exit(1);
  std::atomic<uint32_t> next = first;
  std::vector<std::thread> threads;
  for (int i = 0; i < kWriters; ++i) {
    threads.emplace_back([&] {
      while (true) {
        const uint32_t index = next++;
        const std::string bytes = BytesOf(index);
        if (!(*store)->WritePart(RowOf(job, index, bytes), bytes).ok()) ::_exit(2);
        if (::write(told, &index, sizeof index) != sizeof index) ::_exit(3);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  ::_exit(4);
}

class GroupKillTest : public ::testing::Test {
 protected:
  GroupKillTest() : directory_(::testing::TempDir() + "sheaf-group-kill") {
    std::filesystem::remove_all(directory_);
    const auto store = SqlJobStore::Open(directory_);
    SHEAF_CHECK(store.ok());
    JobSpec spec;
    spec.numeric_profile = "profile";
    FrameSpec frame;
    frame.frame_number = 1;
    frame.scene = {std::string(64, 'a'), 12};
    frame.frame_digest = std::string(64, 'f');
    spec.frames = {frame};
    const auto job = (*store)->CreateJob(spec, "request", absl::UnixEpoch());
    SHEAF_CHECK(job.ok());
    job_ = job->job_id;
  }
  ~GroupKillTest() override { std::filesystem::remove_all(directory_); }

  // Returns the parts that a life acknowledged before it was killed.
  std::vector<uint32_t> LiveAndDie(uint32_t first, absl::Duration kill_after) {
    int pipe[2];
    SHEAF_CHECK(::pipe(pipe) == 0);
    const pid_t child = ::fork();
    SHEAF_CHECK(child >= 0);
    if (child == 0) {
      ::close(pipe[0]);
      ::alarm(static_cast<unsigned>(absl::ToInt64Seconds(kFirstPartMax)));
      WriteUntilKilled(directory_, job_, first, pipe[1]);
    }
    ::close(pipe[1]);
    std::vector<uint32_t> acknowledged;
    uint32_t index = 0;
    const auto take = [&] {
      if (::read(pipe[0], &index, sizeof index) != sizeof index) return false;
      acknowledged.push_back(index);
      return true;
    };
    if (take()) absl::SleepFor(kill_after);
    ::kill(child, SIGKILL);
    int status = 0;
    ::waitpid(child, &status, 0);
    EXPECT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL)
        << "the life ended by itself: status " << status;
    while (take()) {
    }
    ::close(pipe[0]);
    return acknowledged;
  }

  size_t CountFiles() const {
    size_t count = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(directory_ + "/parts")) {
      count += entry.is_regular_file() ? 1 : 0;
    }
    return count;
  }

  const std::string directory_;
  uint64_t job_ = 0;
};

TEST_F(GroupKillTest, NothingAcknowledgedIsLost) {
  const uint64_t kills = NumberOf("SHEAF_KILLS", 5);
  const uint64_t seed =
      NumberOf("SHEAF_SEED", static_cast<uint64_t>(absl::ToUnixNanos(absl::Now())));
  std::printf("SHEAF_SEED=%llu\n", static_cast<unsigned long long>(seed));
  std::mt19937_64 random(seed);
  size_t acknowledged_count = 0, unacknowledged_rows = 0, dropped_files = 0;
  for (uint64_t life = 0; life < kills; ++life) {
    const auto first = static_cast<uint32_t>(life) * kPartsPerLifeMax;
    const std::vector<uint32_t> acknowledged =
        LiveAndDie(first, kKillAfterMax * std::uniform_real_distribution<double>(0, 1)(random));
    ASSERT_FALSE(acknowledged.empty());
    acknowledged_count += acknowledged.size();
    const size_t files_before = CountFiles();
    const auto store = SqlJobStore::Open(directory_);
    ASSERT_TRUE(store.ok()) << store.status();
    const auto parts = (*store)->LoadParts(job_);
    ASSERT_TRUE(parts.ok()) << parts.status();
    EXPECT_TRUE(parts->lost.empty()) << "rows without their bytes";
    std::map<uint64_t, const PartRow*> rows;
    for (const PartRow& row : parts->rows) rows[row.key.block.first / 16] = &row;
    for (const uint32_t index : acknowledged) {
      ASSERT_TRUE(rows.contains(index)) << "part " << index << " was acknowledged and is gone";
    }
    for (const auto& [index, row] : rows) {
      const absl::StatusOr<std::string> bytes = (*store)->ReadPart(*row);
      ASSERT_TRUE(bytes.ok()) << bytes.status();
      EXPECT_EQ(*bytes, BytesOf(static_cast<uint32_t>(index)));
    }
    EXPECT_EQ(CountFiles(), rows.size()) << "files without rows stay";
    unacknowledged_rows += rows.size() - acknowledged.size();
    dropped_files += files_before - rows.size();
    // The next run finds only its own parts, so that many runs stay quick.
    ASSERT_TRUE((*store)->RemoveFrameParts({job_, 1}).ok());
  }
  std::printf(
      "%llu kills: %zu parts acknowledged, none lost; %zu more were durable, %zu files of "
      "unfinished groups were dropped\n",
      static_cast<unsigned long long>(kills), acknowledged_count, unacknowledged_rows,
      dropped_files);
}

}  // namespace
}  // namespace sheaf::coordinator
