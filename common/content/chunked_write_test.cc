// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Blobs by chunks: a changed file reuses the chunks of a stored one, an interrupted write continues
// at a chunk, and stores of earlier versions are used too.
#include "common/content/chunked_write.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <random>
#include <string>

#include "common/base/check.h"
#include "common/base/digest.h"
#include "common/content/chunk_cutter.h"

namespace sheaf {
namespace {

class ChunkedWriteTest : public ::testing::Test {
 protected:
  ChunkedWriteTest() {
    folder_ = ::testing::TempDir() + "/chunked_write_" +
              ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(folder_);
    std::mt19937_64 random(1);
    bytes_.resize(12 << 20);
    for (char& byte : bytes_) byte = static_cast<char>(random());
    changed_ = bytes_;
    changed_.insert(6 << 20, "some more bytes");
    Open();
  }
  ~ChunkedWriteTest() override { std::filesystem::remove_all(folder_); }
  // As a coordinator that starts.
  void Open() {
    auto store = BlobStore::Open(folder_);
    SHEAF_CHECK(store.ok());
    store_ = *std::move(store);
    index_ = std::make_unique<ChunkIndex>(store_.get());
  }
  ChunkList ListOf(const std::string& bytes) const {
    const std::string path = folder_ + "/file";
    std::ofstream(path, std::ios::binary) << bytes;
    const absl::StatusOr<ChunkList> list = CutFile(path);
    SHEAF_CHECK(list.ok());
    return *list;
  }
  ChunkPlan Plan(const ChunkList& list) {
    const absl::StatusOr<ChunkPlan> plan = PlanChunks(*store_, index_.get(), list);
    SHEAF_CHECK(plan.ok());
    return *plan;
  }
  static std::string_view Chunk(const std::string& bytes, const ChunkList& list, size_t index) {
    uint64_t offset = 0;
    for (size_t i = 0; i < index; ++i) offset += list.chunks[i].size_bytes;
    return std::string_view(bytes).substr(offset, list.chunks[index].size_bytes);
  }
  // Sends the first count of the missing chunks; completes the blob if they are all.
  absl::Status Send(const std::string& bytes, const ChunkPlan& plan, size_t count = SIZE_MAX) {
    const ChunkList list = ListOf(bytes);
    absl::StatusOr<ChunkedWrite> write =
        ChunkedWrite::Begin(*store_, index_.get(), list, plan.offset_bytes);
    if (!write.ok()) return write.status();
    for (size_t i = 0; i < plan.missing.size(); ++i) {
      if (i == count) return absl::OkStatus();
      const size_t index = plan.missing[i];
      absl::Status status = write->Append(index, Chunk(bytes, list, index));
      if (!status.ok()) return status;
    }
    return write->Finish();
  }
  absl::Status SendAll(const std::string& bytes) { return Send(bytes, Plan(ListOf(bytes))); }
  void ExpectStored(const std::string& bytes) {
    const BlobDigest digest{Sha256Hex(bytes), bytes.size()};
    EXPECT_TRUE(store_->Verify(digest).ok());
    EXPECT_EQ(*index_->ListOf(digest), ListOf(bytes));
  }

  std::string folder_, bytes_, changed_;
  std::unique_ptr<BlobStore> store_;
  std::unique_ptr<ChunkIndex> index_;
};

TEST_F(ChunkedWriteTest, AChangedFileSendsOnlyTheChunksThatChanged) {
  const ChunkList list = ListOf(bytes_);
  EXPECT_EQ(Plan(list).missing.size(), list.chunks.size());
  ASSERT_TRUE(SendAll(bytes_).ok());
  ExpectStored(bytes_);
  EXPECT_TRUE(Plan(list).complete);
  for (const bool restarted : {false, true}) {
    if (restarted) Open();
    const ChunkPlan plan = Plan(ListOf(changed_));
    EXPECT_GE(plan.missing.size(), 1U);
    EXPECT_LE(plan.missing.size(), 3U);
  }
  ASSERT_TRUE(SendAll(changed_).ok());
  ExpectStored(changed_);
}

TEST_F(ChunkedWriteTest, ABlobOfAnEarlierStoreIsCutWhenItsListIsAskedFor) {
  const absl::StatusOr<BlobDigest> blob = store_->Put(bytes_);
  ASSERT_TRUE(blob.ok());
  ExpectStored(bytes_);
  EXPECT_LE(Plan(ListOf(changed_)).missing.size(), 3U);
}

TEST_F(ChunkedWriteTest, AnInterruptedWriteGoesOnAtTheChunkThatWasNotWhole) {
  const ChunkList list = ListOf(bytes_);
  ASSERT_TRUE(Send(bytes_, Plan(list), 3).ok());
  // A kill in the middle of a chunk leaves a part of it.
  std::ofstream(store_->PartialPath(list.blob), std::ios::app | std::ios::binary)
      << Chunk(bytes_, list, 3).substr(0, 1000);
  Open();
  const ChunkPlan plan = Plan(list);
  EXPECT_EQ(plan.missing.front(), 3U);
  EXPECT_EQ(plan.missing.size(), list.chunks.size() - 3);
  ASSERT_TRUE(Send(bytes_, plan).ok());
  ExpectStored(bytes_);
}

TEST_F(ChunkedWriteTest, AChunkWhoseBlobIsGoneIsAskedForAgain) {
  ASSERT_TRUE(SendAll(bytes_).ok());
  const ChunkPlan plan = Plan(ListOf(changed_));
  std::filesystem::remove(store_->FinalPath({Sha256Hex(bytes_), bytes_.size()}));
  const absl::Status status = Send(changed_, plan);
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  ASSERT_TRUE(SendAll(changed_).ok());
  ExpectStored(changed_);
}

TEST_F(ChunkedWriteTest, OtherBytesThanAChunksAreRefusedAndTheRestGoesOn) {
  const ChunkList list = ListOf(bytes_);
  {
    absl::StatusOr<ChunkedWrite> write = ChunkedWrite::Begin(*store_, index_.get(), list, 0);
    ASSERT_TRUE(write.ok()) << write.status();
    ASSERT_TRUE(write->Append(0, Chunk(bytes_, list, 0)).ok());
    std::string altered(Chunk(bytes_, list, 1));
    altered[5] = static_cast<char>(altered[5] + 1);
    EXPECT_TRUE(absl::IsInvalidArgument(write->Append(1, altered)));
    EXPECT_TRUE(absl::IsInvalidArgument(write->Append(0, Chunk(bytes_, list, 0)))) << "behind";
  }
  EXPECT_EQ(Plan(list).missing.front(), 1U);
  ASSERT_TRUE(SendAll(bytes_).ok());
  EXPECT_TRUE(absl::IsAlreadyExists(Send(bytes_, ChunkPlan{})));
}

}  // namespace
}  // namespace sheaf
