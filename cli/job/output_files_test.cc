// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/output_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "common/base/file.h"

namespace sheaf::cli {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

class OutputFilesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = ::testing::TempDir() + "/sheaf-outputs-XXXXXX";
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    directory_ = pattern;
  }
  void TearDown() override { fs::remove_all(directory_); }
  std::string Path(const std::string& name) const { return directory_ + "/" + name; }
  std::string Write(const std::string& name) const {
    std::ofstream(Path(name)) << name;
    return Path(name);
  }

  std::string directory_;
};

TEST_F(OutputFilesTest, OutputsNeverOverwriteInputs) {
  const std::string input = Write("room.exr");
  fs::create_hard_link(input, Path("hard.exr"));
  fs::create_symlink("room.exr", Path("soft.exr"));
  for (const char* name : {"room.exr", "hard.exr", "soft.exr", "./room.exr"}) {
    const std::string path = Path(name);
    const absl::Status status = CheckOutputs({path}, {Write("other.pbrt"), input});
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << path;
    EXPECT_THAT(std::string(status.message()), HasSubstr(input));
  }
  EXPECT_TRUE(CheckOutputs({"", Path("new.exr")}, {input, Path("gone.pbrt")}).ok());
}

TEST_F(OutputFilesTest, OutputsMustBeDifferentFiles) {
  EXPECT_TRUE(absl::IsInvalidArgument(CheckOutputs({Path("a.exr"), Path("a.exr")}, {})));
  fs::create_symlink("a.exr", Path("b.exr"));
  EXPECT_TRUE(absl::IsInvalidArgument(CheckOutputs({Path("a.exr"), Path("b.exr")}, {})));
  EXPECT_TRUE(CheckOutputs({Path("a.exr"), Path("a.png")}, {}).ok());
}

TEST_F(OutputFilesTest, MissingFoldersAreFoundBeforeRendering) {
  EXPECT_TRUE(absl::IsNotFound(CheckOutputs({Path("a.exr"), Path("none/b.exr")}, {})));
  EXPECT_TRUE(absl::IsFailedPrecondition(CheckOutputs({"/dev/full"}, {})));
  EXPECT_TRUE(absl::IsFailedPrecondition(CheckOutputs({directory_}, {})));
  EXPECT_TRUE(fs::is_empty(directory_));
}

TEST_F(OutputFilesTest, ExtensionsMustMatchTheContent) {
  for (const char* name : {"", "a.exr", "a.PNG", "out/a.####.exr"}) {
    EXPECT_TRUE(CheckOutputName("-o", name, {".exr", ".png"}).ok()) << name;
  }
  for (const char* name : {"-", "a.jpg", "a.tif", "a", "out/", "a.exr.gz"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(CheckOutputName("-o", name, {".exr", ".png"}))) << name;
  }
  EXPECT_THAT(std::string(CheckOutputName("-o", "a.jpg", {".exr", ".png"}).message()),
              HasSubstr("-o a.jpg: Sheaf writes only .exr or .png here"));
}

TEST_F(OutputFilesTest, UnwritableOutputsAreSavedElsewhere) {
  const std::string wanted = Path("gone/room.exr");
  ::setenv("TMPDIR", directory_.c_str(), 1);
  const absl::Status status = WriteOrKeep(
      wanted, [](const std::string& path) { return WriteFileAtomically(path, "image"); });
  ::unsetenv("TMPDIR");
  EXPECT_TRUE(absl::IsFailedPrecondition(status));
  const std::string text(status.message());
  const size_t at = text.find("it is kept as ");
  ASSERT_NE(at, std::string::npos) << text;
  const std::string kept = text.substr(at + 14);
  EXPECT_THAT(kept, ::testing::StartsWith(directory_));
  EXPECT_EQ(*ReadWholeFile(kept), "image");
}

TEST_F(OutputFilesTest, FallbackNamesFitTheFileSystem) {
  ::setenv("TMPDIR", directory_.c_str(), 1);
  const std::string name = std::string(251, 'n') + ".exr";
  const absl::Status status = WriteOrKeep("/nowhere/" + name, [](const std::string& path) {
    return WriteFileAtomically(path, "image");
  });
  ::unsetenv("TMPDIR");
  const std::string text(status.message());
  const size_t at = text.find("it is kept as ");
  ASSERT_NE(at, std::string::npos) << text;
  const std::string kept = text.substr(at + 14);
  EXPECT_THAT(kept, ::testing::StartsWith(directory_));
  EXPECT_THAT(kept, ::testing::EndsWith("n.exr"));
  EXPECT_EQ(*ReadWholeFile(kept), "image");
}

}  // namespace
}  // namespace sheaf::cli
