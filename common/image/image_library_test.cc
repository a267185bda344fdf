// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/image_library.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "common/base/file.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf {
namespace {

using ::testing::HasSubstr;

bool HasOpenImageIO() {
  std::ifstream maps("/proc/self/maps");
  const std::string text{std::istreambuf_iterator<char>(maps), {}};
  return text.find("libOpenImageIO") != std::string::npos;
}

// Writes an image and reads it back, and checks when the library is loaded.
bool ComesWithTheFirstImage(const std::string& path) {
  if (HasOpenImageIO()) return false;
  TextureCache textures(1 << 20);
  if (!WritePng(path, 4, 4, std::vector<Rgb8>(16, Rgb8{10, 20, 30})).ok()) return false;
  if (HasOpenImageIO()) return false;
  return textures.Open(path, {}).ok() && HasOpenImageIO();
}

// A scene without images pays neither start time nor memory for the library.
TEST(ImageLibraryTest, LoadsWithTheFirstImage) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");  // In a separate process.
  const std::string path = ::testing::TempDir() + "/sheaf_image_library_test.png";
  EXPECT_EXIT(std::exit(ComesWithTheFirstImage(path) ? 0 : 1), ::testing::ExitedWithCode(0), "");
}

TEST(ImageLibraryTest, ReportsAMissingLibrary) {
  const auto library = LoadImageLibraryFrom({"/nowhere", "/neither"});
  ASSERT_EQ(library.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(library.status().message()),
              HasSubstr("libsheaf_openimageio.so is not in /nowhere or /neither"));
}

TEST(ImageLibraryTest, ReportsAVersionMismatch) {
  const std::filesystem::path folder =
      std::filesystem::path(::testing::TempDir()) / "sheaf_image_library_test";
  std::filesystem::create_directories(folder);
  ASSERT_TRUE(WriteFileAtomically((folder / kImageLibraryFile).string(), "no module").ok());
  const auto library = LoadImageLibraryFrom({folder.string()});
  ASSERT_EQ(library.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(library.status().message()), HasSubstr(kImageLibraryFile));
}

}  // namespace
}  // namespace sheaf
