// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/http_preview.h"

#include <limits>

#include "coordinator/service/http_fake_farm.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

TEST(HttpPreviewTest, AppliesTheSrgbCurveAndClamps) {
  FramePicture picture = MakeFakePicture(4, 1, 0);
  picture.planes[0] = {0.0f, 0.2158605f, 1.0f, 7.0f};
  picture.planes[1] = {-1.0f, std::numeric_limits<float>::quiet_NaN(), 0.5f, 0.001f};
  const auto display = MakeDisplayPicture(picture);
  ASSERT_TRUE(display.ok());
  EXPECT_EQ(display->pixels[0], (Rgb8{0, 0, 0}));
  EXPECT_EQ(display->pixels[1], (Rgb8{128, 0, 0}));  // 0.21586 in light is level 128.
  EXPECT_EQ(display->pixels[2], (Rgb8{255, 188, 0}));
  EXPECT_EQ(display->pixels[3], (Rgb8{255, 3, 0}));
}

TEST(HttpPreviewTest, LargePicturesAreAveragedDownUnderTheLimit) {
  const FramePicture picture = MakeFakePicture(2048, 2048, 1);
  const auto display = MakeDisplayPicture(picture);
  ASSERT_TRUE(display.ok());
  EXPECT_EQ(display->width_px, 1024);
  EXPECT_EQ(display->height_px, 1024);
  EXPECT_EQ(display->pixels.size(), size_t{1024} * 1024);
  EXPECT_EQ(display->pixels.back(), (Rgb8{255, 255, 255}));
}

TEST(HttpPreviewTest, APictureWithoutColourIsAnError) {
  FramePicture picture = MakeFakePicture(1, 1, 1);
  picture.channel_names = {"X", "Y", "Z"};
  EXPECT_FALSE(MakeDisplayPicture(picture).ok());
}

TEST(HttpPreviewTest, EncodesOnceAVersion) {
  FakeFarm farm;
  farm.preview.version = 3;
  farm.preview.picture = MakeFakePicture(4, 2, 0.5f);
  FrameView frame = MakeFakeJob("1").frames[0];
  PreviewCache cache;
  uint64_t version = 0;
  const auto first = cache.Png(farm, "1", frame, &version);
  ASSERT_TRUE(first.ok()) << first.status();
  EXPECT_EQ(version, 3u);
  EXPECT_EQ(first->substr(1, 3), "PNG");
  // The farm moves on; the kept picture still answers for its own version.
  farm.preview.version = 4;
  farm.preview.picture = MakeFakePicture(4, 2, 0.1f);
  EXPECT_EQ(*cache.Png(farm, "1", frame, &version), *first);
  frame.preview_version = 4;
  EXPECT_NE(*cache.Png(farm, "1", frame, &version), *first);
  EXPECT_EQ(version, 4u);
}

}  // namespace
}  // namespace sheaf::coordinator
