// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/content/blob_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "common/base/digest.h"

namespace sheaf {
namespace {

class BlobStoreTest : public ::testing::Test {
 protected:
  void SetUp() override {
    directory_ = ::testing::TempDir() + "/blob_store_" +
                 ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(directory_);
    store_ = *BlobStore::Open(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  static BlobDigest DigestOf(const std::string& bytes) { return {Sha256Hex(bytes), bytes.size()}; }
  void Alter(const BlobDigest& digest, const std::string& bytes) {
    const std::string path = store_->FinalPath(digest);
    ::chmod(path.c_str(), 0644);
    std::ofstream(path, std::ios::binary) << bytes;
  }

  std::string directory_;
  std::unique_ptr<BlobStore> store_;
};

TEST_F(BlobStoreTest, ReturnsStoredBlobs) {
  const absl::StatusOr<BlobDigest> digest = store_->Put("hello");
  ASSERT_TRUE(digest.ok()) << digest.status();
  EXPECT_EQ(*digest, DigestOf("hello"));
  EXPECT_EQ(*store_->ReadChunk(*digest, 0, 100), "hello");
  EXPECT_EQ(*store_->ReadChunk(*digest, 1, 3), "ell");
  EXPECT_EQ(*store_->ReadChunk(*digest, 5, 3), "");
  EXPECT_EQ(store_->ReadChunk(*digest, 6, 3).status().code(), absl::StatusCode::kOutOfRange);
  EXPECT_TRUE(store_->Verify(*digest).ok());
  EXPECT_TRUE(store_->Put("hello").ok());
}

TEST_F(BlobStoreTest, ADiscardedUploadLeavesNothing) {
  const BlobDigest digest = DigestOf("hello");
  absl::StatusOr<BlobWriter> writer = store_->BeginWrite(digest, 0);
  ASSERT_TRUE(writer.ok());
  ASSERT_TRUE(writer->Append("hel").ok());
  writer->Discard();
  EXPECT_EQ(writer->committed_bytes(), 3u) << "for accounts";
  EXPECT_TRUE(writer->Flush().ok());
  EXPECT_FALSE(std::filesystem::exists(store_->PartialPath(digest)));
  EXPECT_TRUE(store_->BeginWrite(digest, 0).ok()) << "its lock has gone with it";
}

TEST_F(BlobStoreTest, ListsMissingBlobsInOrder) {
  const BlobDigest stored = *store_->Put("stored");
  const BlobDigest a = DigestOf("a"), b = DigestOf("b");
  EXPECT_THAT(*store_->FindMissing({b, stored, a}), ::testing::ElementsAre(b, a));
  EXPECT_EQ(store_->FindMissing({{"../../x", 1}}).status().code(),
            absl::StatusCode::kInvalidArgument);
}

TEST_F(BlobStoreTest, ResumesAnInterruptedUpload) {
  const std::string bytes = "first half, second half";
  const BlobDigest digest = DigestOf(bytes);
  {
    absl::StatusOr<BlobWriter> writer = store_->BeginWrite(digest, 0);
    ASSERT_TRUE(writer.ok()) << writer.status();
    ASSERT_TRUE(writer->Append(bytes.substr(0, 10)).ok());
  }
  store_ = *BlobStore::Open(directory_);
  EXPECT_EQ(store_->GetWriteStatus(digest)->committed_bytes, 10u);
  EXPECT_EQ(store_->BeginWrite(digest, 4).status().code(), absl::StatusCode::kOutOfRange);
  absl::StatusOr<BlobWriter> writer = store_->BeginWrite(digest, 10);
  ASSERT_TRUE(writer.ok()) << writer.status();
  ASSERT_TRUE(writer->Append(bytes.substr(10)).ok());
  ASSERT_TRUE(writer->Commit().ok());
  EXPECT_TRUE(store_->GetWriteStatus(digest)->complete);
  EXPECT_EQ(*store_->ReadChunk(digest, 0, 100), bytes);
}

TEST_F(BlobStoreTest, OffsetZeroRestartsAnUpload) {
  const BlobDigest digest = DigestOf("right");
  ASSERT_TRUE(store_->BeginWrite(digest, 0)->Append("wro").ok());
  absl::StatusOr<BlobWriter> writer = store_->BeginWrite(digest, 0);
  ASSERT_TRUE(writer->Append("right").ok());
  EXPECT_TRUE(writer->Commit().ok());
}

TEST_F(BlobStoreTest, RefusesBytesWithAnotherDigest) {
  const BlobDigest digest = DigestOf("right");
  {
    absl::StatusOr<BlobWriter> writer = store_->BeginWrite(digest, 0);
    ASSERT_TRUE(writer->Append("wrong").ok());
    EXPECT_EQ(writer->Commit().code(), absl::StatusCode::kInvalidArgument);
  }
  EXPECT_FALSE(store_->PathOf(digest).ok());
  EXPECT_EQ(store_->GetWriteStatus(digest)->committed_bytes, 0u);
}

TEST_F(BlobStoreTest, RefusesBytesOfTheWrongSize) {
  const BlobDigest digest = DigestOf("12345");
  absl::StatusOr<BlobWriter> writer = store_->BeginWrite(digest, 0);
  EXPECT_EQ(writer->Append("123456").code(), absl::StatusCode::kInvalidArgument);
  ASSERT_TRUE(writer->Append("123").ok());
  EXPECT_EQ(writer->Commit().code(), absl::StatusCode::kInvalidArgument);
  ASSERT_TRUE(writer->Append("45").ok());
}

TEST_F(BlobStoreTest, OnlyOneWriterPerBlob) {
  const BlobDigest digest = DigestOf("shared");
  {
    absl::StatusOr<BlobWriter> writer = store_->BeginWrite(digest, 0);
    ASSERT_TRUE(writer.ok());
    EXPECT_EQ(store_->BeginWrite(digest, 0).status().code(), absl::StatusCode::kUnavailable);
    ASSERT_TRUE(writer->Append("shared").ok());
    ASSERT_TRUE(writer->Commit().ok());
  }
  EXPECT_EQ(store_->BeginWrite(digest, 0).status().code(), absl::StatusCode::kAlreadyExists);
}

TEST_F(BlobStoreTest, DamagedBlobsAreRequestedAgain) {
  const BlobDigest digest = *store_->Put("precious");
  const std::string path = *store_->PathOf(digest);
  ::chmod(path.c_str(), 0644);
  std::ofstream(path, std::ios::binary) << "previous";
  EXPECT_EQ(store_->Verify(digest).code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(*store_->FindMissing({digest}), ::testing::ElementsAre(digest));
  EXPECT_TRUE(store_->Put("precious").ok());
  EXPECT_TRUE(store_->Verify(digest).ok());
}

TEST_F(BlobStoreTest, AlteredBlobsAreMissing) {
  const BlobDigest digest = *store_->Put("precious");
  Alter(digest, "previous");
  EXPECT_THAT(*store_->FindMissing({digest}), ::testing::ElementsAre(digest));
  EXPECT_FALSE(store_->GetWriteStatus(digest)->complete);
  EXPECT_THAT(store_->TakeLost(), ::testing::ElementsAre(digest));
  EXPECT_TRUE(store_->TakeLost().empty());
  EXPECT_TRUE(std::filesystem::exists(directory_ + "/damaged/" + digest.sha256_hex));
  EXPECT_TRUE(store_->Put("precious").ok());
  EXPECT_EQ(*store_->ReadChunk(digest, 0, 100), "precious");
}

TEST_F(BlobStoreTest, AlteredBytesAreNeverRead) {
  const BlobDigest digest = *store_->Put("precious");
  Alter(digest, "previous");
  EXPECT_EQ(store_->ReadChunk(digest, 0, 100).status().code(), absl::StatusCode::kDataLoss);
  EXPECT_EQ(store_->ReadChunk(digest, 0, 100).status().code(), absl::StatusCode::kNotFound);
}

TEST_F(BlobStoreTest, BlobsOfEarlierProcessesAreVerified) {
  const BlobDigest digest = *store_->Put("precious");
  Alter(digest, "previous");
  store_ = *BlobStore::Open(directory_);
  EXPECT_THAT(*store_->FindMissing({digest}), ::testing::ElementsAre(digest));
}

// A bit lost by the disk changes no file time.
TEST_F(BlobStoreTest, BlobsAreVerifiedPeriodically) {
  BlobStore::Clock::time_point now;
  store_ = *BlobStore::Open(directory_, [&] { return now; });
  const BlobDigest digest = *store_->Put("precious");
  const FileState state = *store_->StateOf(digest);
  now += kVerifiedAgeMax + std::chrono::seconds(1);
  EXPECT_EQ(*store_->StateOf(digest), state);
  EXPECT_EQ(store_->digest_count(), 1u);
  EXPECT_EQ(*store_->StateOf(digest), state);
  EXPECT_EQ(store_->digest_count(), 1u) << "what was just digested is known";
}

TEST_F(BlobStoreTest, KeepsABoundedNumberOfDamagedBlobs) {
  for (size_t i = 0; i < 2 * kDamagedKeptMax; ++i) {
    const BlobDigest digest = *store_->Put("blob " + std::to_string(i));
    Alter(digest, "damage");
    EXPECT_FALSE(store_->PathOf(digest).ok());
  }
  const std::filesystem::directory_iterator files(directory_ + "/damaged");
  EXPECT_EQ(static_cast<size_t>(std::distance(begin(files), end(files))), kDamagedKeptMax);
}

TEST_F(BlobStoreTest, ListsBlobsAndUploads) {
  const BlobDigest stored = *store_->Put("stored"), begun = DigestOf("begun");
  EXPECT_TRUE(store_->BeginWrite(begun, 0)->Append("beg").ok());
  const std::vector<StoredBlob> blobs = store_->List(), uploads = store_->ListUploads();
  ASSERT_EQ(blobs.size(), 1u);
  EXPECT_EQ(blobs[0].digest, stored);
  EXPECT_LT(blobs[0].age, std::chrono::minutes(10));
  ASSERT_EQ(uploads.size(), 1u);
  EXPECT_EQ(uploads[0].digest, (BlobDigest{begun.sha256_hex, 3}));
}

TEST_F(BlobStoreTest, BlobsThatAClientFoundAreNotRemoved) {
  BlobStore::Clock::time_point now{};
  store_ = *BlobStore::Open(directory_, [&now] { return now; });
  const BlobDigest digest = *store_->Put("blob");
  std::filesystem::last_write_time(
      store_->FinalPath(digest),
      std::filesystem::file_time_type::clock::now() - std::chrono::hours(50));
  now += std::chrono::hours(30);
  EXPECT_GT(store_->List().at(0).age, std::chrono::hours(29));
  EXPECT_TRUE(store_->FindMissing({digest})->empty());
  now += std::chrono::minutes(59);
  EXPECT_LT(store_->List().at(0).age, std::chrono::hours(1));
  EXPECT_FALSE(store_->Remove(digest));
  now += std::chrono::minutes(2);
  EXPECT_TRUE(store_->Remove(digest));
  EXPECT_FALSE(store_->Remove(digest));
  EXPECT_THAT(*store_->FindMissing({digest}), ::testing::ElementsAre(digest));
  EXPECT_TRUE(store_->TakeLost().empty()) << "it was not lost";
  EXPECT_TRUE(store_->Put("blob").ok());
}

TEST_F(BlobStoreTest, UploadsInProgressAreNotRemoved) {
  const BlobDigest digest = DigestOf("begun");
  {
    const auto writer = store_->BeginWrite(digest, 0);
    ASSERT_TRUE(writer.ok());
    EXPECT_FALSE(store_->RemoveUpload(digest));
  }
  EXPECT_TRUE(store_->RemoveUpload(digest));
  EXPECT_FALSE(store_->RemoveUpload(digest));
}

TEST_F(BlobStoreTest, RefusesAnotherSizeThanStored) {
  BlobDigest digest = *store_->Put("four");
  digest.size_bytes = 5;
  EXPECT_FALSE(store_->PathOf(digest).ok());
  EXPECT_EQ(store_->FindMissing({digest})->size(), 1u);
}

TEST_F(BlobStoreTest, StoresAnEmptyBlob) {
  const absl::StatusOr<BlobDigest> digest = store_->Put("");
  ASSERT_TRUE(digest.ok()) << digest.status();
  EXPECT_EQ(*store_->ReadChunk(*digest, 0, 10), "");
}

}  // namespace
}  // namespace sheaf
