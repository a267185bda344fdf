// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "cli/job/follow_job.h"
#include "common/base/digest.h"
#include "common/base/file.h"

namespace sheaf::cli {
namespace {

class StoreBlobTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::remove_all(directory_);
    auto store = BlobStore::Open(directory_ + "/store");
    ASSERT_TRUE(store.ok()) << store.status();
    store_ = *std::move(store);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  BlobSource File(const std::string& bytes, const std::string& announced) const {
    const std::string path = directory_ + "/file";
    std::ofstream(path, std::ios::binary) << bytes;
    return {{Sha256Hex(announced), announced.size()}, path, ""};
  }

  const std::string directory_ = ::testing::TempDir() + "store_blob_test";
  std::unique_ptr<BlobStore> store_;
};

TEST_F(StoreBlobTest, StoresFilesOfSeveralPiecesAndBytes) {
  const std::string large(2 * kBlobChunkBytesMax + 7, 'x');
  const BlobSource file = File(large, large);
  ASSERT_TRUE(StoreBlob(*store_, file).ok());
  EXPECT_EQ(*ReadWholeFile(*store_->PathOf(file.digest), 1 << 30), large);
  EXPECT_EQ(store_->digest_count(), 0) << "bytes are hashed while they are written, and once";
  const BlobSource bytes{{Sha256Hex("manifest"), 8}, "", "manifest"};
  ASSERT_TRUE(StoreBlob(*store_, bytes).ok());
  EXPECT_TRUE(StoreBlob(*store_, bytes).ok()) << "it is there already";
  EXPECT_EQ(*ReadWholeFile(*store_->PathOf(bytes.digest), 1 << 30), "manifest");
}

TEST_F(StoreBlobTest, RefusesFilesThatHaveChanged) {
  for (const BlobSource& blob : {File("other bytes", "some  bytes"), File("short", "longer")}) {
    std::ofstream(blob.path, std::ios::binary).write("other bytes", 11);
    const BlobSource shorter{{blob.digest.sha256_hex, 12}, blob.path, ""};
    EXPECT_TRUE(absl::IsFailedPrecondition(StoreBlob(*store_, shorter))) << "it is too short";
    const BlobSource changed{{blob.digest.sha256_hex, 11}, blob.path, ""};
    const absl::Status status = StoreBlob(*store_, changed);
    EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
    EXPECT_EQ(store_->FindMissing({changed.digest})->size(), 1);
  }
}

}  // namespace
}  // namespace sheaf::cli
