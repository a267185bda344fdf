// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/dropped/dropped_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "common/base/file.h"
#include "tests/support/temporary_path.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

class DroppedFilesTest : public ::testing::Test {
 protected:
  void Open(const DroppedLimits& limits) {
    auto files = DroppedFiles::Create(folder_, limits, [this](uint64_t bytes, const auto& write) {
      if (bytes > space_) return absl::ResourceExhaustedError("no space");
      space_ -= bytes;
      return write();
    });
    ASSERT_TRUE(files.ok()) << files.status();
    files_ = *std::move(files);
  }
  void SetUp() override { Open({.bytes_max = 100, .files_max = 3}); }
  ~DroppedFilesTest() override { std::filesystem::remove_all(folder_); }
  std::string Error(const std::string& name, uint64_t offset, const std::string& bytes) {
    return std::string(files_->Append(name, offset, bytes).status().message());
  }
  std::string Read(const std::string& name) {
    return ReadWholeFile(folder_ + "/files/" + name).value_or("nothing");
  }
  const std::string folder_ = sheaf::testing::TemporaryPath("dropped");
  uint64_t space_ = 1000;
  std::unique_ptr<DroppedFiles> files_;
};

TEST_F(DroppedFilesTest, PiecesBecomeFilesInFolders) {
  EXPECT_EQ(*files_->Append("shot/scene.pbrt", 0, "World"), 5u);
  EXPECT_EQ(*files_->Append("shot/scene.pbrt", 5, "Begin"), 10u);
  EXPECT_EQ(*files_->Append("shot/empty", 0, ""), 0u);
  EXPECT_EQ(Read("shot/scene.pbrt"), "WorldBegin");
  EXPECT_EQ(Read("shot/empty"), "");
  EXPECT_EQ(files_->bytes(), 10u);
  EXPECT_EQ(files_->file_count(), 2u);
  files_.reset();
  EXPECT_FALSE(std::filesystem::exists(folder_));
}

TEST_F(DroppedFilesTest, APieceThatIsSentAgainCountsOnce) {
  EXPECT_EQ(*files_->Append("a", 0, "12345"), 5u);
  EXPECT_EQ(*files_->Append("a", 0, "12345"), 5u);
  EXPECT_EQ(*files_->Append("a", 3, "4567"), 7u) << "the first two are there";
  EXPECT_EQ(Read("a"), "1234567");
  EXPECT_EQ(files_->bytes(), 7u);
  EXPECT_TRUE(absl::IsOutOfRange(files_->Append("a", 8, "x").status()));
}

TEST_F(DroppedFilesTest, NamesThatLeadElsewhereAreRefused) {
  for (const char* name : {"../a", "/etc/passwd", "a/../../b", "", "a//b", "a\\b", "a\nb"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(files_->Append(name, 0, "x").status())) << name;
  }
  EXPECT_EQ(files_->file_count(), 0u);
}

TEST_F(DroppedFilesTest, ANameIsAFileOrAFolder) {
  ASSERT_TRUE(files_->Append("a", 0, "x").ok());
  EXPECT_THAT(Error("a/b", 0, "x"), HasSubstr("lies in a folder that was sent as a file"));
  ASSERT_TRUE(files_->Append("c/d", 0, "x").ok());
  EXPECT_THAT(Error("c", 0, "x"), HasSubstr("as a folder and as a file"));
}

TEST_F(DroppedFilesTest, LimitsHold) {
  ASSERT_TRUE(files_->Append("a", 0, std::string(60, 'a')).ok());
  EXPECT_THAT(Error("b", 0, std::string(41, 'b')), HasSubstr("larger than 100 bytes"));
  ASSERT_TRUE(files_->Append("b", 0, std::string(40, 'b')).ok());
  ASSERT_TRUE(files_->Append("c", 0, "").ok());
  EXPECT_THAT(Error("d", 0, ""), HasSubstr("more than 3 files"));
  EXPECT_TRUE(absl::IsResourceExhausted(files_->Append("a", 60, "x").status()));
  EXPECT_EQ(files_->bytes(), 100u);
}

TEST_F(DroppedFilesTest, SpaceIsClaimedForWhatIsNew) {
  space_ = 8;
  ASSERT_TRUE(files_->Append("a", 0, "12345").ok());
  ASSERT_TRUE(files_->Append("a", 3, "4567").ok()) << "two of them are there";
  EXPECT_EQ(space_, 1u);
  EXPECT_EQ(Error("a", 7, "89"), "no space");
  EXPECT_EQ(Error("b", 0, "12"), "no space");
  EXPECT_EQ(Read("a"), "1234567");
  EXPECT_EQ(files_->file_count(), 1u) << "nothing is left of what was refused";
  ASSERT_TRUE(files_->Append("a", 7, "8").ok());
}

TEST_F(DroppedFilesTest, OnlyFilesBelowTheFolderAreOpened) {
  ASSERT_TRUE(files_->Append("a/scene.pbrt", 0, "text").ok());
  EXPECT_TRUE(OpenBeneath(folder_, "files/a/scene.pbrt").ok());
  EXPECT_TRUE(OpenBeneath(folder_, "files/a/../a/scene.pbrt").ok());
  std::filesystem::create_symlink("/etc/hostname", folder_ + "/scratch/link");
  std::filesystem::create_directory_symlink("/etc", folder_ + "/scratch/etc");
  for (const char* name :
       {"/etc/hostname", "../../etc/hostname", "scratch/link", "scratch/etc/hostname"}) {
    const absl::Status status = OpenBeneath(folder_, name).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << name << ": " << status;
  }
  EXPECT_FALSE(OpenBeneath(folder_, "files/a").ok()) << "a folder";
  EXPECT_TRUE(absl::IsNotFound(OpenBeneath(folder_, "files/b").status()));
  ASSERT_TRUE(files_->ClearScratch().ok());
  EXPECT_TRUE(std::filesystem::is_empty(folder_ + "/scratch"));
  EXPECT_EQ(Read("a/scene.pbrt"), "text");
}

}  // namespace
}  // namespace sheaf::coordinator
