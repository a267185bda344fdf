// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/format/shown_layer.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "common/film/denoised_output.h"
#include "common/film/exr/external_layer.h"

namespace sheaf::cli {
namespace {

TEST(ShownLayerTest, WithoutAWishItIsTheLeastNoisyOne) {
  FrameImage image = MakeFrameImage({0, 0, 1, 1}, 1, 1);
  *image.Find("G") = {1};
  EXPECT_EQ((*ImageOfLayer(image, "")->Find("G"))[0], 1);
  FilmOutputs outputs;
  AddDenoised(&outputs);
  image = MakeFrameImage({0, 0, 1, 1}, 1, 1, outputs);
  *image.Find("G") = {1};
  *image.Find("denoised.G") = {2};
  EXPECT_EQ((*ImageOfLayer(image, "")->Find("G"))[0], 2);
  SetExternalLayer({std::vector<float>{3}, std::vector<float>{3}, std::vector<float>{3}}, &image);
  EXPECT_EQ((*ImageOfLayer(image, "")->Find("G"))[0], 3);
  EXPECT_EQ((*ImageOfLayer(image, "denoised")->Find("G"))[0], 2);
  EXPECT_EQ((*ImageOfLayer(image, "image")->Find("G"))[0], 1);
}

TEST(ShownLayerTest, AMissingLayerIsNamedWithItsOption) {
  const FrameImage image = MakeFrameImage({0, 0, 1, 1}, 1, 1);
  const absl::Status status = ImageOfLayer(image, "denoised").status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status));
  EXPECT_EQ(status.message(), "the image has no layer denoised; --denoise adds it");
}

}  // namespace
}  // namespace sheaf::cli
