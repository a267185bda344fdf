// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Parts that concurrent calls write: groups, and calls that meet at one key.
#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "common/base/check.h"
#include "common/base/digest.h"
#include "coordinator/store/tests/test_databases.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

class GroupsTest : public JobStoreFixture {
 protected:
  static PartRow RowOf(const std::string& bytes) {
    PartRow row;
    row.key.frame = {1, 1};
    row.key.tile = {0, 0, 16, 16};
    row.key.block = {0, 16};
    row.digest = {Sha256Hex(bytes), bytes.size()};
    row.worker_id = "w";
    return row;
  }
};

TEST_P(GroupsTest, EqualPartsOfConcurrentCallsAreStoredOnce) {
  const std::string bytes = "equal";
  std::atomic<int> stored = 0, refused = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&] {
      const absl::Status status = store_->WritePart(RowOf(bytes), bytes);
      stored += status.ok() ? 1 : 0;
      refused += absl::IsAlreadyExists(status) ? 1 : 0;
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(stored, 1);
  EXPECT_EQ(refused, 7);
  EXPECT_EQ(*store_->ReadPart(RowOf(bytes)), bytes);
  EXPECT_EQ(store_->PartsBytes(), bytes.size());
}

TEST_P(GroupsTest, AnotherPartOfAKeyLeavesNoFile) {
  ASSERT_TRUE(store_->WritePart(RowOf("one"), "one").ok());
  EXPECT_EQ(store_->WritePart(RowOf("other"), "other").code(), absl::StatusCode::kAlreadyExists);
  EXPECT_FALSE(std::filesystem::exists(store_->PartPath(RowOf("other"))));
  EXPECT_EQ(*store_->ReadPart(RowOf("one")), "one");
}

TEST_P(GroupsTest, AFileWithoutRowIsReplaced) {
  const std::string path = store_->PartPath(RowOf("bytes"));
  std::filesystem::create_directories(std::filesystem::path(path).parent_path());
  std::ofstream(path) << "half";
  ASSERT_TRUE(store_->WritePart(RowOf("bytes"), "bytes").ok());
  EXPECT_EQ(*store_->ReadPart(RowOf("bytes")), "bytes");
}

// One call's error does not affect the other calls of its group.
TEST_P(GroupsTest, AKeyThatExistsConcernsItsOwnCallAlone) {
  ASSERT_TRUE(store_->WritePart(RowOf("first"), "first").ok());
  std::vector<std::thread> threads;
  std::atomic<int> stored = 0, refused = 0;
  for (uint64_t i = 0; i < 8; ++i) {
    threads.emplace_back([&, i] {
      const std::string bytes = "part " + std::to_string(i);
      PartRow row = RowOf(bytes);
      row.key.block.first = i % 2 == 0 ? 0 : i * 16;
      const absl::Status status = store_->WritePart(row, bytes);
      stored += status.ok() ? 1 : 0;
      refused += absl::IsAlreadyExists(status) ? 1 : 0;
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(stored, 4);
  EXPECT_EQ(refused, 4);
}

// Groups of many rows, some of which meet at one key: a call is told that its part is stored where
// the row is that of its part, and nowhere else.
TEST_P(GroupsTest, EachCallOfALargeGroupHearsOfItsOwnPart) {
  constexpr uint64_t kCalls = 180;
  ASSERT_TRUE(store_->WritePart(RowOf("first"), "first").ok());
  std::vector<PartRow> rows;
  for (uint64_t i = 0; i < kCalls; ++i) {
    PartRow row = RowOf("part " + std::to_string(i));
    // A third of the calls meet the stored part, a third meet in pairs at their own keys, the rest
    // do not collide.
    if (i % 3 == 1) row.key.block.first = 16 * (1 + i / 6);
    if (i % 3 == 2) row.key.block.first = 16 * (kCalls + i);
    rows.push_back(row);
  }
  std::vector<absl::Status> told(kCalls);
  std::vector<std::thread> threads;
  // The first call waits for this transaction, and the others meanwhile become a group.
  ASSERT_TRUE(OpenDatabase()
                  ->InTransaction([&] {
                    for (uint64_t i = 0; i < kCalls; ++i) {
                      threads.emplace_back([&, i] {
                        told[i] = store_->WritePart(rows[i], "part " + std::to_string(i));
                      });
                    }
                    std::this_thread::sleep_for(std::chrono::milliseconds(100));
                    return absl::OkStatus();
                  })
                  .ok());
  for (std::thread& thread : threads) thread.join();
  for (uint64_t i = 0; i < kCalls; ++i) {
    const auto stored = store_->FindPart(rows[i].key);
    ASSERT_TRUE(stored.ok() && stored->has_value()) << i;
    const bool is_mine = (*stored)->digest == rows[i].digest;
    EXPECT_EQ(told[i].code(), is_mine ? absl::StatusCode::kOk : absl::StatusCode::kAlreadyExists)
        << i;
    EXPECT_EQ(std::filesystem::exists(store_->PartPath(rows[i])), is_mine) << i;
  }
  EXPECT_EQ(store_->ListParts(1)->size(), 1 + kCalls / 6 + kCalls / 3);
}

// One call with several parts: each has its own status.
TEST_P(GroupsTest, PartsOfOneCallAreStoredTogether) {
  ASSERT_TRUE(store_->WritePart(RowOf("first"), "first").ok());
  std::vector<std::string> bytes;
  std::vector<PartRow> rows;
  for (uint64_t i = 0; i < 40; ++i) {
    bytes.push_back("part " + std::to_string(i));
    rows.push_back(RowOf(bytes.back()));
    rows.back().key.block.first = 16 * i;  // The first one meets the stored part.
  }
  std::vector<JobStore::NewPart> parts;
  for (size_t i = 0; i < rows.size(); ++i) parts.push_back({&rows[i], &bytes[i]});
  const std::vector<absl::Status> told = store_->WriteParts(parts);
  ASSERT_EQ(told.size(), parts.size());
  EXPECT_TRUE(absl::IsAlreadyExists(told[0])) << told[0];
  EXPECT_FALSE(std::filesystem::exists(store_->PartPath(rows[0])));
  uint64_t size_bytes = 5;
  for (size_t i = 1; i < rows.size(); ++i) {
    EXPECT_TRUE(told[i].ok()) << told[i];
    EXPECT_EQ(*store_->ReadPart(rows[i]), bytes[i]);
    size_bytes += bytes[i].size();
  }
  EXPECT_EQ(store_->PartsBytes(), size_bytes);
  EXPECT_TRUE(store_->WriteParts({}).empty());
}

// Calls with the same parts in other orders wait for each other, and never in a circle.
TEST_P(GroupsTest, CallsThatShareParts) {
  constexpr size_t kParts = 6;
  std::vector<std::string> bytes;
  std::vector<PartRow> rows;
  for (uint64_t i = 0; i < kParts; ++i) {
    bytes.push_back("part " + std::to_string(i));
    rows.push_back(RowOf(bytes.back()));
    rows.back().key.block.first = 16 * i;
  }
  std::atomic<int> stored = 0, refused = 0;
  std::vector<std::thread> threads;
  for (size_t t = 0; t < 8; ++t) {
    threads.emplace_back([&, t] {
      std::vector<JobStore::NewPart> parts;
      for (size_t i = 0; i < kParts; ++i) {
        const size_t part = t % 2 == 0 ? (i + t) % kParts : kParts - 1 - i;
        parts.push_back({&rows[part], &bytes[part]});
      }
      for (const absl::Status& status : store_->WriteParts(parts)) {
        stored += status.ok() ? 1 : 0;
        refused += absl::IsAlreadyExists(status) ? 1 : 0;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(stored, static_cast<int>(kParts));
  EXPECT_EQ(refused, static_cast<int>(7 * kParts));
}

TEST_P(GroupsTest, AFailedWriteIsRefusedAndTheNextOnesAreNot) {
  const std::string folder = directory_ + "/parts/1";
  std::ofstream(folder) << "a file where the folder of the job should be";
  EXPECT_FALSE(store_->WritePart(RowOf("bytes"), "bytes").ok());
  EXPECT_EQ(store_->PartsBytes(), 0u);
  std::filesystem::remove(folder);
  EXPECT_TRUE(store_->WritePart(RowOf("bytes"), "bytes").ok());
}

SHEAF_ON_ALL_DATABASES(GroupsTest);

}  // namespace
}  // namespace sheaf::coordinator
