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

// Reads images of a usual format and of another, and checks when the library is loaded.
bool ComesWithAnUnusualFormat(const std::string& name) {
  TextureCache textures(1 << 20);
  if (!WritePng(name + ".png", 4, 4, std::vector<Rgb8>(16, Rgb8{10, 20, 30})).ok()) return false;
  if (!textures.Open(name + ".png", {}).ok() || !ReadImage(name + ".png").ok()) return false;
  if (HasOpenImageIO()) return false;
  std::ofstream(name + ".hdr", std::ios::binary)
      << "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n"
      << "\x40\x80\xc0\x80";
  return textures.Open(name + ".hdr", {}).ok() && HasOpenImageIO();
}

// A scene of usual images pays neither start time nor memory for the library.
TEST(ImageLibraryTest, LoadsWithAnUnusualFormat) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");  // In a separate process.
  const std::string name = ::testing::TempDir() + "/sheaf_image_library_test";
  EXPECT_EXIT(std::exit(ComesWithAnUnusualFormat(name) ? 0 : 1), ::testing::ExitedWithCode(0), "");
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
