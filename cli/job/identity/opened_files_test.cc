// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/identity/opened_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace sheaf::cli {
namespace {

using ::testing::HasSubstr;

class OpenedFilesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    directory_ = ::testing::TempDir() + "/opened_files_" +
                 ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(directory_);
    std::filesystem::create_directories(directory_);
    std::ofstream(directory_ + "/a.pbrt") << "one";
    std::ofstream(directory_ + "/b.ply") << "two";
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  std::string directory_;
};

TEST_F(OpenedFilesTest, AFileThatIsSavedMeanwhileIsNamed) {
  OpenedFiles files(directory_);
  ASSERT_TRUE(files.LocalPath("a.pbrt").ok());
  ASSERT_TRUE(files.LocalPath("b.ply").ok());
  EXPECT_EQ(files.States().size(), 2u);
  EXPECT_TRUE(CheckUnchanged(files.States()).ok());
  // As programs save: another file of the same size takes the name.
  std::ofstream(directory_ + "/new") << "six";
  std::filesystem::rename(directory_ + "/new", directory_ + "/b.ply");
  ASSERT_TRUE(files.LocalPath("b.ply").ok());  // Its first state counts.
  const absl::Status changed = CheckUnchanged(files.States());
  EXPECT_TRUE(absl::IsFailedPrecondition(changed));
  EXPECT_THAT(std::string(changed.message()), HasSubstr("b.ply: changed while"));
}

TEST_F(OpenedFilesTest, AFileThatIsRemovedIsNamed) {
  OpenedFiles files(directory_);
  ASSERT_TRUE(files.LocalPath("a.pbrt").ok());
  std::filesystem::remove(directory_ + "/a.pbrt");
  EXPECT_FALSE(CheckUnchanged(files.States()).ok());
}

}  // namespace
}  // namespace sheaf::cli
