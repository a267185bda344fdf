// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/display/select_channels.h"

#include <gtest/gtest.h>

namespace sheaf {
namespace {

TEST(SelectChannelsTest, KeepsWindowAndColor) {
  ImageColor color;
  color.chromaticities = ChromaticitiesOf(Primaries::kAcesCg);
  FrameImage image = MakeFrameImage({1, 2, 2, 3}, 8, 4, {}, color);
  *image.Find("albedo.G") = {0.5f};
  const absl::StatusOr<FrameImage> selected =
      SelectChannels(image, {"albedo.R", "albedo.G", "albedo.B"}, kColorChannels);
  ASSERT_TRUE(selected.ok()) << selected.status();
  EXPECT_EQ(selected->window, image.window);
  EXPECT_EQ(selected->frame_width_px, 8);
  EXPECT_EQ(selected->frame_height_px, 4);
  EXPECT_EQ(selected->color.chromaticities, color.chromaticities);
  EXPECT_EQ(selected->channel_names, kColorChannels);
  EXPECT_EQ((*selected->Find("G"))[0], 0.5f);
}

TEST(SelectChannelsTest, AMissingChannelIsNamed) {
  const absl::Status status =
      SelectChannels(MakeFrameImage({0, 0, 1, 1}, 1, 1), {"key.R"}, {"R"}).status();
  EXPECT_TRUE(absl::IsInternal(status));
  EXPECT_EQ(status.message(), "the image has no channel key.R");
}

}  // namespace
}  // namespace sheaf
