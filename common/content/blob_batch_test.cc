// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Many small blobs in one call: all are there, also the equal ones, and none with wrong bytes.
#include "common/content/blob_batch.h"

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/base/digest.h"

namespace sheaf {
namespace {

class BlobBatchTest : public ::testing::Test {
 protected:
  BlobBatchTest() {
    folder_ = ::testing::TempDir() + "/blob_batch_" +
              ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(folder_);
    auto store = BlobStore::Open(folder_);
    SHEAF_CHECK(store.ok());
    store_ = *std::move(store);
  }
  ~BlobBatchTest() override { std::filesystem::remove_all(folder_); }
  void Add(const std::string& bytes) {
    digests_.push_back({Sha256Hex(bytes), bytes.size()});
    bytes_ += bytes;
  }
  absl::Status Put() { return PutSmallBlobs(*store_, digests_, bytes_); }

  std::string folder_, bytes_;
  std::unique_ptr<BlobStore> store_;
  std::vector<BlobDigest> digests_;
};

TEST_F(BlobBatchTest, StoresEachBlobOnceAndReadsItBack) {
  ASSERT_TRUE(store_->Put("17").ok());  // It is there before.
  for (int i = 0; i < 2000; ++i) Add(absl::StrCat(i % 1500));
  Add("");
  const absl::Status status = Put();
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_TRUE(store_->FindMissing(digests_)->empty());
  EXPECT_EQ(*store_->ReadChunk(digests_[1234], 0, 100), "1234");
  EXPECT_EQ(store_->List().size(), 1501U);
  EXPECT_TRUE(store_->ListUploads().empty());
  EXPECT_TRUE(Put().ok()) << "again";
}

TEST_F(BlobBatchTest, AnotherWritersBlobIsStoredAllTheSame) {
  Add("a blob");
  {
    absl::StatusOr<BlobWriter> other = store_->BeginWrite(digests_[0], 0);
    ASSERT_TRUE(other.ok());
    EXPECT_TRUE(absl::IsUnavailable(Put())) << "the other writer has its lock";
  }
  EXPECT_TRUE(Put().ok());
  EXPECT_TRUE(store_->FindMissing(digests_)->empty());
}

TEST_F(BlobBatchTest, RefusesOtherBytesThanTheDigests) {
  Add("one");
  Add("two");
  bytes_[3] = 'T';
  EXPECT_TRUE(absl::IsInvalidArgument(Put()));
  bytes_[3] = 't';
  bytes_ += "more";
  EXPECT_TRUE(absl::IsInvalidArgument(Put()));
  bytes_.resize(5);
  EXPECT_TRUE(absl::IsInvalidArgument(Put()));
  EXPECT_EQ(store_->FindMissing(digests_)->size(), 2U);
}

TEST_F(BlobBatchTest, RefusesLargeBlobs) {
  Add(std::string(kSmallBlobBytesMax + 1, 'x'));
  EXPECT_TRUE(absl::IsInvalidArgument(Put()));
}

}  // namespace
}  // namespace sheaf
