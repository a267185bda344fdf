// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/derived_files.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <string>

#include "common/base/file.h"
#include "common/scene/file_source.h"

namespace sheaf {
namespace {

TEST(DerivedFilesTest, KeepsEqualBytesOnceAndRemovesThemAtTheEnd) {
  std::string path;
  {
    DerivedFiles files;
    const auto first = files.Put("bytes", "a.png");
    ASSERT_TRUE(first.ok()) << first.status();
    path = *first;
    EXPECT_EQ(*files.Put("bytes", "b.png"), path);
    EXPECT_NE(*files.Put("others", "a.png"), path);
    EXPECT_EQ(*ReadWholeFile(path), "bytes");
    EXPECT_TRUE(path.ends_with(".png"));
  }
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST(DerivedFilesTest, AreFilesOfTheirSource) {
  DirectoryFileSource files(::testing::TempDir(), std::make_shared<DerivedFiles>());
  const auto path = files.DerivedPath("a.glb.image-1.png", "pixels");
  ASSERT_TRUE(path.ok()) << path.status();
  EXPECT_EQ(*files.LocalPath("a.glb.image-1.png"), *path);
  EXPECT_EQ(files.FilesUsed().at("a.glb.image-1.png"), *path);
}

TEST(DerivedFilesTest, AreLookedUpWhereNoneAreWritten) {
  TableFileSource files(std::map<std::string, std::string>{{"a.glb.image-1.png", "/cache/1"}});
  EXPECT_EQ(*files.DerivedPath("a.glb.image-1.png", "ignored"), "/cache/1");
  EXPECT_FALSE(files.DerivedPath("other", "ignored").ok());
  DirectoryFileSource plain(::testing::TempDir());
  EXPECT_FALSE(plain.DerivedPath("no.png", "bytes").ok());
}

}  // namespace
}  // namespace sheaf
