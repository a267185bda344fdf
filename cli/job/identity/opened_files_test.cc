// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/identity/opened_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <string>

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

TEST_F(OpenedFilesTest, FilesOutsideAreNamedForPbrtAndRefusedForGltf) {
  const std::string outside = directory_ + "_outside";
  std::filesystem::create_directories(outside);
  std::filesystem::create_directories(directory_ + "/in");
  std::ofstream(outside + "/secret") << "key";
  std::ofstream(directory_ + "/in/c.bin") << "three";
  std::filesystem::create_symlink(outside + "/secret", directory_ + "/link");
  std::filesystem::create_symlink(outside, directory_ + "/folder");
  std::filesystem::create_symlink("in/c.bin", directory_ + "/within");
  std::filesystem::create_symlink(outside + "/secret", directory_ + "/main.gltf");
  const std::string above = "../" + std::filesystem::path(outside).filename().string() + "/secret";

  OpenedFiles pbrt(directory_, nullptr, "a.pbrt");
  for (const std::string& name :
       {std::string("a.pbrt"), std::string("in/c.bin"), std::string("within"), above,
        outside + "/secret", std::string("link"), std::string("folder/secret")}) {
    EXPECT_TRUE(pbrt.LocalPath(name).ok()) << name;
  }
  EXPECT_EQ(pbrt.Outside(),
            (std::set<std::string>{above, outside + "/secret", "link", "folder/secret"}));

  OpenedFiles gltf(directory_, nullptr, "main.gltf");
  for (const char* const name : {"main.gltf", "in/c.bin", "within"}) {
    EXPECT_TRUE(gltf.LocalPath(name).ok()) << name;
  }
  for (const char* const name : {"link", "folder/secret"}) {
    EXPECT_THAT(
        std::string(gltf.LocalPath(name).status().message()),
        HasSubstr(std::string("file \"") + name + "\" leads outside of the scene's folder"));
  }
  std::filesystem::remove_all(outside);
}

TEST(OutsideNoteTest, CountsAllAndNamesTheFirst) {
  EXPECT_EQ(OutsideNote({}), "");
  EXPECT_EQ(OutsideNote({"../a"}), "1 file outside of the scene's folder is uploaded: ../a");
  EXPECT_EQ(OutsideNote({"/1", "/2", "/3", "/4", "/5", "/6", "/7"}),
            "7 files outside of the scene's folder are uploaded: /1, /2, /3, /4, /5 and 2 more");
}

}  // namespace
}  // namespace sheaf::cli
