// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/format/image_format.h"

#include <gtest/gtest.h>

#include "absl/time/clock.h"

namespace sheaf::cli {
namespace {

TEST(ImageFormatTest, OptionsNameWhatDiffers) {
  EXPECT_TRUE(FormatOptions({}).empty());
  ImageFormat format;
  format.exr = {ExrType::kHalf, ExrCompression::kPiz, ExrParts::kMulti, 64};
  format.depth = ExrDepth::kPlane;
  format.owner = "Anna B";
  format.frames_per_second = "25";
  format.date = true;
  EXPECT_FALSE(format.IsDefault());
  const std::vector<std::pair<std::string, std::string>> expected{
      {"--exr-type", "half"},   {"--exr-compression", "piz"},
      {"--exr-parts", "multi"}, {"--exr-tiles", "64"},
      {"--exr-depth", "plane"}, {"--exr-owner", "Anna B"},
      {"--exr-fps", "25"},      {"--exr-date", ""}};
  EXPECT_EQ(FormatOptions(format), expected);
}

TEST(ImageFormatTest, WrongWishesAreRefused) {
  for (const char* fps : {"0", "-24", "24/0", "24/1/1", "film", "1e3", "99999999999"}) {
    ImageFormat format;
    format.frames_per_second = fps;
    EXPECT_FALSE(CheckImageFormat(format).ok()) << fps;
  }
  ImageFormat format;
  format.comments = "two\nlines";
  EXPECT_FALSE(CheckImageFormat(format).ok());
  format.comments = "one line";
  format.frames_per_second = "24000/1001";
  EXPECT_TRUE(CheckImageFormat(format).ok());
  format.exr = {ExrType::kFloat, ExrCompression::kDwaa, ExrParts::kSingle, 0};
  EXPECT_FALSE(CheckImageFormat(format).ok());
}

TEST(ImageFormatTest, OnlyWhatWasAskedForDependsOnTheRun) {
  v1::Frame frame;
  frame.mutable_progress()->mutable_wall_duration()->set_seconds(90);
  frame.mutable_progress()->mutable_cpu_duration()->set_nanos(500'000'000);
  FrameImage plain;
  AddAttributes({}, frame, absl::Now(), &plain);
  EXPECT_TRUE(plain.attributes.empty());
  EXPECT_TRUE(plain.metadata.empty());
  ImageFormat format;
  format.frames_per_second = "24";
  format.date = format.render_time = true;
  FrameImage image;
  AddAttributes(format, frame, absl::FromUnixSeconds(86400), &image);
  EXPECT_EQ(image.attributes.at("capDate"), "1970:01:02 00:00:00");
  EXPECT_EQ(image.attributes.at("framesPerSecond"), "24/1");
  EXPECT_EQ(image.metadata.at("renderSeconds"), "90");
  EXPECT_EQ(image.metadata.at("cpuSeconds"), "0.5");
}

}  // namespace
}  // namespace sheaf::cli
