// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/input_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>

#include "common/image/image_io.h"
#include "common/scene/pbrt/scene_reader.h"
#include "tests/support/image_files.h"
#include "tests/support/volume/volume_writers.h"

namespace sheaf::cli {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

class InputCheckTest : public ::testing::Test {
 protected:
  void SetUp() override {
    directory_ = ::testing::TempDir() + "/input_check_" +
                 ::testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(directory_);
    fs::create_directories(directory_);
  }
  void TearDown() override { fs::remove_all(directory_); }

  void Write(const std::string& name, const std::string& bytes) const {
    std::ofstream(directory_ + "/" + name, std::ios::binary) << bytes;
  }
  // Runs the checks on a scene whose world has these lines, starting at line 5.
  absl::Status CheckScene(const std::string& lines) const {
    Write("room.pbrt",
          "Film \"rgb\" \"integer xresolution\" 8 \"integer yresolution\" 8\n"
          "Camera \"perspective\"\nWorldBegin\n"
          "Shape \"sphere\"\n" +
              lines);
    DirectoryFileSource files(directory_);
    const absl::StatusOr<ReadSceneResult> read = ReadScene("room.pbrt", files);
    EXPECT_TRUE(read.ok()) << read.status();
    return read.ok() ? InputChecks().Check(read->scene, files) : read.status();
  }

  std::string directory_;
};

TEST_F(InputCheckTest, DamageIsReportedAtTheReferenceInTheScene) {
  const std::string png = *EncodePng(64, 64, std::vector<Rgb8>(64 * 64, Rgb8{200, 100, 50}));
  Write("cut.png", png.substr(0, png.size() / 2));
  Write("garbage.exr", "no image");
  Write("smoke.nvdb", "no volume");
  Write("whole.png", png);
  const absl::Status status = CheckScene(
      "Texture \"wood\" \"spectrum\" \"imagemap\" \"string filename\" \"cut.png\"\n"
      "LightSource \"infinite\" \"string filename\" \"garbage.exr\"\n"
      "MakeNamedMedium \"fog\" \"string type\" \"nanovdb\" \"string filename\" \"smoke.nvdb\"\n"
      "Texture \"good\" \"spectrum\" \"imagemap\" \"string filename\" \"whole.png\"\n");
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  const std::string text(status.message());
  EXPECT_THAT(text, HasSubstr("room.pbrt:5:1: texture \"wood\": cut.png: "));
  EXPECT_THAT(text, HasSubstr("room.pbrt:6:1: light: garbage.exr: "));
  EXPECT_THAT(text, HasSubstr("room.pbrt:7:1: medium \"fog\": smoke.nvdb: "));
  EXPECT_THAT(text, ::testing::Not(HasSubstr("whole.png")));
}

// Files of simulations have a grid of one name for each part.
TEST_F(InputCheckTest, GridsOfOneNameAreNoted) {
  const auto one = [](const sheaf::testing::Voxel&) { return 1.0f; };
  Write("parts.nvdb", sheaf::testing::NvdbFile({{.value = one}, {.value = one}},
                                               sheaf::testing::NvdbCodec::kNone));
  const std::string medium =
      "MakeNamedMedium \"m\" \"string type\" \"nanovdb\" \"string filename\" \"parts.nvdb\"";
  ::testing::internal::CaptureStderr();
  EXPECT_TRUE(CheckScene(medium + "\n").ok());
  EXPECT_THAT(::testing::internal::GetCapturedStderr(),
              HasSubstr("room.pbrt:5:1: medium \"m\": parts.nvdb: several grids are named "
                        "\"density\"; the first is read, and \"density[1]\" names the second"));
  ::testing::internal::CaptureStderr();
  EXPECT_TRUE(CheckScene(medium + " \"string gridname\" \"density[1]\"\n").ok());
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

TEST_F(InputCheckTest, OnlyHeadersOfLargeImagesAreRead) {
  const int edge = 1100;
  const std::string png =
      *EncodePng(edge, edge, std::vector<Rgb8>(static_cast<size_t>(edge) * edge));
  Write("large.png", png.substr(0, png.size() - 100));
  Write("large garbage.png", "\x89PNG" + std::string(100, 'x'));
  const std::string texture = "Texture \"a\" \"spectrum\" \"imagemap\" \"string filename\" ";
  EXPECT_TRUE(CheckScene(texture + "\"large.png\"\n").ok());
  EXPECT_FALSE(CheckScene(texture + "\"large garbage.png\"\n").ok());
}

// A worker would refuse them, after the scene has been sent to it.
TEST_F(InputCheckTest, ImagesWithoutColorsAndTooLargeOnesAreRefused) {
  Write("depth.exr", sheaf::testing::ExrBytes({.channels = {{"A", 1}, {"Z", 1}}}));
  Write("wide.exr", sheaf::testing::ExrBytes(
                        {.width = 80'000'000, .channels = {{"Y", 1}}, .header_only = true}));
  Write("light.exr", sheaf::testing::ExrBytes({.width = 8193, .channels = {{"Y", 1}}}));
  const std::string texture = "Texture \"a\" \"spectrum\" \"imagemap\" \"string filename\" ";
  for (const auto& [lines, expected] : std::map<std::string, std::string>{
           {texture + "\"depth.exr\"\n",
            "room.pbrt:5:1: texture \"a\": depth.exr: its channels are A, Z, but an image has R, G "
            "and B, or Y"},
           {texture + "\"wide.exr\"\n",
            "room.pbrt:5:1: texture \"a\": wide.exr: its header claims 80000000 x 1 pixels of 1 "
            "channels, but 131072 columns and rows are the most"},
           {"LightSource \"infinite\" \"string filename\" \"light.exr\"\n",
            "room.pbrt:5:1: light: light.exr: its header claims 8193 x 1 pixels of 1 channels, but "
            "8192 columns and rows are the most"}}) {
    const absl::Status status = CheckScene(lines);
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr(expected));
  }
  EXPECT_TRUE(CheckScene(texture + "\"light.exr\"\n").ok());
}

TEST_F(InputCheckTest, ScenesWithoutFilesAreAccepted) { EXPECT_TRUE(CheckScene("").ok()); }

}  // namespace
}  // namespace sheaf::cli
