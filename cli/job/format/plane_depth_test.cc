// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/format/plane_depth.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "common/film/exr/resumed_image.h"

namespace sheaf::cli {
namespace {

// The left half of a frame of 8 by 4 pixels; all pixels but the first see something 10 away.
FrameImage MakeImage() {
  FrameImage image = MakeFrameImage({0, 0, 4, 4}, 8, 4);
  std::ranges::fill(*image.Find("depth.Z"), 10.0f);
  std::ranges::fill(*image.Find("A"), 1.0f);
  image.Find("depth.Z")->front() = image.Find("A")->front() = 0;
  return image;
}

// A camera at 1000, 20, 3 that looks along -x, its frame 2 by 1 wide at distance 1.
const std::string kToCamera = "0 0 -1 0 0 1 0 0 1 0 0 0 -3 -20 1000 1";
const std::string kToNdc = "-0.5 -0.5 0 -1 0 -1 0 0 0.5 0 0 0 498.5 520 0 1000";

TEST(PlaneDepthTest, PerspectiveDistancesBecomeThoseFromThePlane) {
  FrameImage image = MakeImage();
  image.attributes = {{"worldToCamera", kToCamera}, {"worldToNDC", kToNdc}};
  ASSERT_TRUE(MakePlaneDepth(&image).ok());
  const std::vector<float>& depth = *image.Find("depth.Z");
  EXPECT_EQ(depth[0], kBackgroundDepth);
  for (int32_t y = 0; y < 4; ++y) {
    for (int32_t x = y == 0 ? 1 : 0; x < 4; ++x) {
      const double right = (x + 0.5) / 8 * 2 - 1, up = 0.5 - (y + 0.5) / 4;
      EXPECT_NEAR(depth[static_cast<size_t>(4 * y + x)],
                  10 / std::sqrt(1 + right * right + up * up), 1e-5)
          << x << ", " << y;
    }
  }
  EXPECT_EQ(image.metadata.at(kDepthKey), kPlaneDepth);
  EXPECT_EQ((*image.Find("A"))[1], 1);
}

// Distances are in units of the world, however the camera is scaled.
TEST(PlaneDepthTest, TheCamerasScaleDoesNotCount) {
  FrameImage plain = MakeImage(), scaled = MakeImage();
  plain.attributes = {{"worldToCamera", kToCamera}, {"worldToNDC", kToNdc}};
  scaled.attributes = {{"worldToCamera", "0 0 -4 0 0 4 0 0 4 0 0 0 -12 -80 4000 1"},
                       {"worldToNDC", "-2 -2 0 -4 0 -4 0 0 2 0 0 0 1994 2080 0 4000"}};
  ASSERT_TRUE(MakePlaneDepth(&plain).ok());
  ASSERT_TRUE(MakePlaneDepth(&scaled).ok());
  for (size_t i = 0; i < 16; ++i) {
    EXPECT_FLOAT_EQ((*scaled.Find("depth.Z"))[i], (*plain.Find("depth.Z"))[i]);
  }
}

TEST(PlaneDepthTest, OrthographicDistancesAreFromThePlaneAlready) {
  FrameImage image = MakeImage();
  image.attributes = {{"worldToCamera", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"},
                      {"worldToNDC", "1 0 0 0 0 -1 0 0 0 0 1 0 0.5 0.5 0 1"}};
  ASSERT_TRUE(MakePlaneDepth(&image).ok());
  EXPECT_EQ((*image.Find("depth.Z"))[0], kBackgroundDepth);
  EXPECT_EQ((*image.Find("depth.Z"))[1], 10);
}

TEST(PlaneDepthTest, CamerasWithoutAPlaneKeepTheirDistances) {
  FrameImage image = MakeImage();
  image.attributes = {{"worldToCamera", kToCamera}};
  EXPECT_TRUE(absl::IsFailedPrecondition(MakePlaneDepth(&image)));
  EXPECT_EQ(ImageDigest(image), ImageDigest(MakeImage()));
  EXPECT_FALSE(image.metadata.contains(kDepthKey));
}

TEST(PlaneDepthTest, SuchACopyCannotBeResumed) {
  FrameImage image = MakeImage();
  image.attributes = {{"worldToCamera", kToCamera}, {"worldToNDC", kToNdc}};
  image.metadata = {{kFrameDigestKey, "f"}, {kImageDigestKey, ImageDigest(image)}};
  ASSERT_TRUE(MakePlaneDepth(&image).ok());
  const auto resumed = ResumedImage::Make(std::move(image), {}, {});
  EXPECT_NE(resumed.status().message().find("--exr-depth ray"), std::string::npos)
      << resumed.status();
}

}  // namespace
}  // namespace sheaf::cli
