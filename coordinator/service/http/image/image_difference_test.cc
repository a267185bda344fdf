// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/http/image/image_difference.h"

#include <limits>

#include "coordinator/service/http/image/false_color.h"
#include "gtest/gtest.h"
#include "tests/support/farm/http_fake_farm.h"

namespace sheaf::coordinator {
namespace {

TEST(ImageDifferenceTest, EqualImagesDifferNowhere) {
  const FrameImage image = MakeFakeImage(4, 2, 0.5f);
  const auto display = MakeDifference(image, image, DifferenceKind::kAbsolute);
  ASSERT_TRUE(display.ok()) << display.status();
  EXPECT_EQ(display->range, (LayerRange{0, 0}));
  for (const Rgb8& pixel : display->pixels) EXPECT_EQ(pixel, Viridis(0));
}

TEST(ImageDifferenceTest, SmallDifferencesOfFloatsAreSeen) {
  FrameImage image = MakeFakeImage(4, 2, 0.5f);
  const FrameImage other = image;
  for (size_t c = 0; c < 3; ++c) image.planes[c][5] += 1e-4f;
  const auto absolute = MakeDifference(image, other, DifferenceKind::kAbsolute);
  ASSERT_TRUE(absolute.ok()) << absolute.status();
  EXPECT_NEAR(absolute->range->high, 1e-4, 1e-7);
  EXPECT_EQ(absolute->pixels[5], Viridis(1));
  EXPECT_EQ(absolute->pixels[4], Viridis(0));
  // The denominator is 0.5 + a tenth of the mean.
  const auto relative = MakeDifference(image, other, DifferenceKind::kRelative);
  ASSERT_TRUE(relative.ok()) << relative.status();
  EXPECT_NEAR(relative->range->high, 1e-4 / 0.55, 1e-6);
}

TEST(ImageDifferenceTest, WhatIsNoNumberIsGray) {
  FrameImage image = MakeFakeImage(4, 2, 0.5f);
  image.planes[1][3] = std::numeric_limits<float>::quiet_NaN();
  const auto display = MakeDifference(image, MakeFakeImage(4, 2, 0.4f), DifferenceKind::kAbsolute);
  ASSERT_TRUE(display.ok()) << display.status();
  EXPECT_EQ(display->pixels[3], kUnknownColor);
  EXPECT_NE(display->pixels[2], kUnknownColor);
}

TEST(ImageDifferenceTest, OtherSizesAreRefused) {
  const auto display = MakeDifference(MakeFakeImage(4, 2, 0.5f), MakeFakeImage(4, 3, 0.5f),
                                      DifferenceKind::kAbsolute);
  EXPECT_TRUE(absl::IsFailedPrecondition(display.status())) << display.status();
}

}  // namespace
}  // namespace sheaf::coordinator
