// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// BlobStore with an ObjectStore: what the directory loses is fetched again.
#include <filesystem>

#include "common/base/file.h"
#include "common/content/blob_batch.h"
#include "common/content/blob_store.h"
#include "common/objects/folder_objects.h"
#include "gtest/gtest.h"

namespace sheaf {
namespace {

class BlobStoreObjectsTest : public ::testing::Test {
 protected:
  BlobStoreObjectsTest() {
    std::filesystem::remove_all(folder_);
    objects_ = *FolderObjects::Open(folder_ + "/objects", /*is_durable=*/false);
    Open();
  }
  void Open() {
    auto opened = BlobStore::Open(
        folder_ + "/blobs", [this] { return now_; }, objects_.get());
    EXPECT_TRUE(opened.ok()) << opened.status();
    store_ = *std::move(opened);
  }
  std::string ObjectPath(const BlobDigest& digest) const {
    return folder_ + "/objects/" + digest.sha256_hex.substr(0, 2) + "/" + digest.sha256_hex;
  }
  void Alter(const std::string& path, const std::string& bytes) {
    ASSERT_TRUE(std::filesystem::remove(path));
    ASSERT_TRUE(WriteFileOnce(path, bytes).ok());
  }

  const std::string folder_ = ::testing::TempDir() + "/blob_store_objects";
  BlobStore::Clock::time_point now_ = BlobStore::Clock::now();
  std::unique_ptr<FolderObjects> objects_;
  std::unique_ptr<BlobStore> store_;
};

TEST_F(BlobStoreObjectsTest, EachBlobIsAnObjectToo) {
  const BlobDigest digest = *store_->Put("hello");
  EXPECT_EQ(*ReadWholeFile(ObjectPath(digest)), "hello");
  const BlobDigest a{Sha256Hex("a"), 1}, b{Sha256Hex("b"), 1};
  ASSERT_TRUE(PutSmallBlobs(*store_, {a, b}, "ab").ok());
  EXPECT_EQ(*ReadWholeFile(ObjectPath(b)), "b");
}

TEST_F(BlobStoreObjectsTest, ADirectoryThatIsLostIsFetched) {
  const BlobDigest digest = *store_->Put("hello");
  const BlobDigest other = *store_->Put("");
  store_.reset();
  std::filesystem::remove_all(folder_ + "/blobs");
  Open();
  EXPECT_EQ(store_->List().size(), 2u);
  EXPECT_TRUE(store_->FindMissing({digest, other})->empty());
  EXPECT_EQ(*store_->ReadChunk(digest, 0, 10), "hello");
  EXPECT_EQ(*ReadWholeFile(store_->FinalPath(digest)), "hello");
  EXPECT_TRUE(absl::IsNotFound(store_->PathOf({Sha256Hex("none"), 4}).status()));
}

TEST_F(BlobStoreObjectsTest, ADamagedFileIsFetched) {
  const BlobDigest digest = *store_->Put("hello");
  Alter(store_->FinalPath(digest), "hallo");
  EXPECT_EQ(*store_->ReadChunk(digest, 0, 10), "hello");
}

TEST_F(BlobStoreObjectsTest, WhatIsDamagedThereTooIsLost) {
  const BlobDigest digest = *store_->Put("hello");
  Alter(ObjectPath(digest), "hullo");
  Alter(store_->FinalPath(digest), "hallo");
  EXPECT_TRUE(absl::IsDataLoss(store_->PathOf(digest).status()));
  EXPECT_EQ(store_->FindMissing({digest})->size(), 1u);
  ASSERT_TRUE(store_->Put("hello").ok());
  EXPECT_EQ(*ReadWholeFile(ObjectPath(digest)), "hello");
}

TEST_F(BlobStoreObjectsTest, ADamagedOrLostObjectIsStoredAgain) {
  const BlobDigest digest = *store_->Put("hello");
  EXPECT_FALSE(store_->RepairObject(digest).value_or(true));
  Alter(ObjectPath(digest), "hullo");
  EXPECT_TRUE(store_->RepairObject(digest).value_or(false));
  EXPECT_EQ(*ReadWholeFile(ObjectPath(digest)), "hello");
  std::filesystem::remove(ObjectPath(digest));
  EXPECT_TRUE(store_->RepairObject(digest).value_or(false));
  EXPECT_EQ(*ReadWholeFile(ObjectPath(digest)), "hello");
}

TEST_F(BlobStoreObjectsTest, ARemovedBlobIsNotFetchedAgain) {
  const BlobDigest digest = *store_->Put("hello");
  EXPECT_FALSE(store_->Remove(digest)) << "it was asked for lately";
  now_ += kAskedKept + std::chrono::minutes(1);
  EXPECT_TRUE(store_->Remove(digest));
  EXPECT_FALSE(std::filesystem::exists(ObjectPath(digest)));
  EXPECT_TRUE(absl::IsNotFound(store_->PathOf(digest).status()));
  EXPECT_TRUE(store_->List().empty());
}

}  // namespace
}  // namespace sheaf
