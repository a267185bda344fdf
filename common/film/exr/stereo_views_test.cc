// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/exr/stereo_views.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include "common/exr/exr_header_scan.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/exr/exr_format.h"

namespace sheaf {
namespace {

// A stereo image whose pixels all differ.
FrameImage StereoImage() {
  FrameImage image = MakeFrameImage({0, 0, 6, 3}, 6, 3);
  for (size_t c = 0; c < image.planes.size(); ++c) {
    for (size_t p = 0; p < image.planes[c].size(); ++p) {
      image.planes[c][p] = static_cast<float>(100 * c + p);
    }
  }
  image.metadata[kViewsKey] = kStereoViews;
  return image;
}

std::vector<std::string> ChannelsOf(const std::string& bytes) {
  std::vector<std::string> names;
  const ExrFileHeader file = *ScanExrHeader(bytes);
  for (const ExrChannel& channel : file.parts[0].channels) names.push_back(channel.name);
  return names;
}

TEST(StereoViewsTest, ChannelsAreNamedByView) {
  for (const char* name : {"R", "A", "albedo.R", "samples.X", "stderr.B"}) {
    for (const size_t view : {size_t{0}, size_t{1}}) {
      const auto channel = ChannelOfView(ViewChannelName(name, view));
      ASSERT_TRUE(channel.has_value()) << name;
      EXPECT_EQ(channel->first, view) << name;
    }
  }
  EXPECT_EQ(ViewChannelName("R", 0), "R");
  EXPECT_EQ(ViewChannelName("R", 1), "right.R");
  EXPECT_EQ(ViewChannelName("albedo.R", 0), "albedo.left.R");
  EXPECT_EQ(ViewChannelName("depth.Z", 1), "depth.right.Z");
  EXPECT_EQ(ChannelOfView("samples.left.X")->second, "samples");
  EXPECT_FALSE(ChannelOfView("albedo.R").has_value());
  EXPECT_FALSE(ChannelOfView("u").has_value());
}

TEST(StereoViewsTest, FilesHaveBothViewsUnderTheirNames) {
  const std::string bytes = EncodeFrameImage(StereoImage());
  const ExrHeader header = ScanExrHeader(bytes)->parts[0];
  EXPECT_EQ(header.data_window.x1 - header.data_window.x0, 3);
  const std::vector<std::string> names = ChannelsOf(bytes);
  for (const char* name : {"R", "right.R", "albedo.left.R", "albedo.right.R", "samples.left.X"}) {
    EXPECT_NE(std::ranges::find(names, name), names.end()) << name;
  }
  EXPECT_EQ(std::ranges::find(names, "albedo.R"), names.end());
  EXPECT_NE(bytes.find(std::string("multiView\0stringvector\0", 23)), std::string::npos);
}

TEST(StereoViewsTest, ImagesComeBackSideBySide) {
  const FrameImage image = StereoImage();
  for (const ExrFormat& format : {ExrFormat{}, ExrFormat{.compression = ExrCompression::kPiz}}) {
    const absl::StatusOr<FrameImage> read = DecodeFrameImage(EncodeFrameImage(image, format));
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_EQ(ImageDigest(*read), ImageDigest(image));
    EXPECT_EQ(read->window, image.window);
    EXPECT_EQ(read->frame_width_px, image.frame_width_px);
  }
}

TEST(StereoViewsTest, TheDifferenceOfTheEyesIsOfNoView) {
  FrameImage image = StereoImage();
  AddEyeDifference(&image);
  for (size_t p = 0; p < image.planes.back().size(); ++p) {
    image.planes.back()[p] = static_cast<float>(p / 6 * 3 + p % 3);
  }
  const std::string bytes = EncodeFrameImage(image);
  const std::vector<std::string> names = ChannelsOf(bytes);
  EXPECT_EQ(std::ranges::count(names, "difference.stderr.B"), 1);
  const absl::StatusOr<FrameImage> read = DecodeFrameImage(bytes);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(ImageDigest(*read), ImageDigest(image));
}

TEST(StereoViewsTest, OnlyColorsOfViewsAreRounded) {
  FrameImage image = StereoImage();
  for (std::vector<float>& plane : image.planes) plane.assign(plane.size(), 1 + 0x1p-20f);
  const FrameImage read = *DecodeFrameImage(EncodeFrameImage(image, {.type = ExrType::kHalf}));
  EXPECT_EQ((*read.Find("albedo.R"))[5], 1);
  EXPECT_EQ((*read.Find("stderr.R"))[5], 1 + 0x1p-20f);
}

TEST(StereoViewsTest, OtherImagesStayAsTheyAre) {
  FrameImage image = StereoImage();
  image.metadata.clear();
  const FrameImage read = *DecodeFrameImage(EncodeFrameImage(image));
  EXPECT_EQ(ImageDigest(read), ImageDigest(image));
  // A view that lacks a channel: another program has written the file.
  FrameImage split = SplitViews(StereoImage());
  split.channel_names[1] = "right.other";
  JoinViews(&split);
  EXPECT_EQ(split.window.Width(), 3);
}

}  // namespace
}  // namespace sheaf
