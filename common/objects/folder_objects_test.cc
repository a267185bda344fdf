// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/objects/folder_objects.h"

#include <algorithm>
#include <filesystem>

#include "gtest/gtest.h"

namespace sheaf {
namespace {

class FolderObjectsTest : public ::testing::Test {
 protected:
  FolderObjectsTest() {
    std::filesystem::remove_all(directory_);
    auto opened = FolderObjects::Open(directory_, /*is_durable=*/true);
    EXPECT_TRUE(opened.ok()) << opened.status();
    objects_ = *std::move(opened);
  }

  const std::string directory_ = ::testing::TempDir() + "/folder_objects";
  std::unique_ptr<FolderObjects> objects_;
};

TEST_F(FolderObjectsTest, KeepsObjectsAsFiles) {
  ASSERT_TRUE(objects_->Put("7/1/a.exr", "bytes", PutMode::kIfAbsent).ok());
  ASSERT_TRUE(objects_->Sync().ok());
  EXPECT_EQ(*ReadWholeFile(directory_ + "/7/1/a.exr"), "bytes");
  EXPECT_TRUE(absl::IsAlreadyExists(objects_->Put("7/1/a.exr", "other", PutMode::kIfAbsent)));
  const FileDigest digest{Sha256Hex("bytes"), 5};
  EXPECT_EQ(*objects_->Get("7/1/a.exr", digest), "bytes");
  EXPECT_EQ(*objects_->GetRange("7/1/a.exr", 1, 3), "yte");
  EXPECT_EQ(*objects_->GetRange("7/1/a.exr", 5, 3), "");
  EXPECT_EQ(*objects_->Head("7/1/a.exr"), 5u);
  EXPECT_TRUE(absl::IsNotFound(objects_->Get("7/1/b.exr", digest).status()));
  EXPECT_TRUE(absl::IsNotFound(objects_->Head("7/1/b.exr").status()));
  for (const char* other : {"bytez", "longer bytes"}) {
    ASSERT_TRUE(objects_->Put("7/1/a.exr", other, PutMode::kReplace).ok());
    EXPECT_TRUE(absl::IsDataLoss(objects_->Get("7/1/a.exr", digest).status())) << other;
  }
  EXPECT_FALSE(objects_->TicketToPut("7/1/c.exr", digest).has_value());
}

TEST_F(FolderObjectsTest, ListsAndRemovesFolders) {
  for (const char* key : {"7/1/a", "7/2/b", "8/1/c"}) {
    ASSERT_TRUE(objects_->Put(key, "x", PutMode::kReplace).ok());
  }
  std::vector<std::string> keys;
  ASSERT_TRUE(objects_->List("7/", [&](const StoredObject& o) { keys.push_back(o.key); }).ok());
  std::sort(keys.begin(), keys.end());
  EXPECT_EQ(keys, (std::vector<std::string>{"7/1/a", "7/2/b"}));
  EXPECT_EQ(objects_->ListFolders("")->size(), 2u);
  EXPECT_TRUE(objects_->ListFolders("9/")->empty());
  ASSERT_TRUE(objects_->RemoveFolder("7/1/").ok());
  EXPECT_TRUE(std::filesystem::exists(directory_ + "/7"));
  ASSERT_TRUE(objects_->RemoveFolder("7/2/").ok());
  EXPECT_FALSE(std::filesystem::exists(directory_ + "/7")) << "an empty folder goes";
  EXPECT_TRUE(objects_->Remove("8/1/c").ok());
  EXPECT_TRUE(objects_->Remove("8/1/c").ok());
  EXPECT_TRUE(absl::IsInvalidArgument(objects_->RemoveFolder("")));
}

TEST_F(FolderObjectsTest, RefusesKeysThatLeadElsewhere) {
  for (const char* key : {"", "/a", "a/", "../a", "a/../b", "a//b", "a b", "a/./b", "ä"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(objects_->Put(key, "x", PutMode::kReplace))) << key;
  }
}

}  // namespace
}  // namespace sheaf
