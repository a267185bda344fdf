// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/settings/path_shares.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sheaf {
namespace {

using ::testing::HasSubstr;

RenderSettings SharingBy(const std::string& techniques) {
  RenderSettings settings;
  settings.techniques = *TechniqueSet::Parse(techniques);
  return settings;
}

TEST(PathSharesTest, FramesOfSharedPathsHaveOneTile) {
  const SceneDescription scene;
  for (const char* techniques : {"camera+sharing", "camera+sharing+views", "camera+mutations"}) {
    const absl::StatusOr<FrameSettings> settings = ResolveSettings(scene, SharingBy(techniques));
    ASSERT_TRUE(settings.ok()) << settings.status();
    EXPECT_TRUE(HasOneTile(*settings));
    EXPECT_FALSE(settings->IsStereo());
    EXPECT_EQ(WhyNoSharing(*settings), "");
  }
  EXPECT_FALSE(HasOneTile(*ResolveSettings(scene, {})));
}

TEST(PathSharesTest, EyesMayShareThemToo) {
  RenderSettings settings = SharingBy("camera+sharing+views");
  settings.eye_distance = 0.1f;
  const absl::StatusOr<FrameSettings> resolved = ResolveSettings(SceneDescription(), settings);
  ASSERT_TRUE(resolved.ok()) << resolved.status();
  EXPECT_TRUE(resolved->IsStereo());
  EXPECT_TRUE(SharesViews(resolved->techniques));
}

TEST(PathSharesTest, EyesDoNotMutateThem) {
  RenderSettings settings = SharingBy("camera+mutations");
  settings.eye_distance = 0.1f;
  EXPECT_EQ(ResolveSettings(SceneDescription(), settings).status().code(),
            absl::StatusCode::kInvalidArgument);
}

TEST(PathSharesTest, OtherFramesAreRefused) {
  const auto expect_refused = [](const RenderSettings& settings, const std::string& why) {
    const absl::StatusOr<FrameSettings> resolved = ResolveSettings(SceneDescription(), settings);
    ASSERT_FALSE(resolved.ok()) << why;
    EXPECT_THAT(resolved.status().message(), HasSubstr("--techniques camera+"));
    EXPECT_THAT(resolved.status().message(), HasSubstr(why));
  };
  RenderSettings settings = SharingBy("camera+sharing");
  settings.crop = PixelRect{0, 0, 8, 8};
  expect_refused(settings, "remove the crop");
  expect_refused(SharingBy("camera+light+sharing"), "not those of the techniques camera+light;");
  expect_refused(SharingBy("camera+guiding+sharing+views"), "camera+guiding;");
  expect_refused(SharingBy("camera+light+mutations"), "of the techniques camera+light;");
  expect_refused(SharingBy("camera+sharing+mutations"), "of the techniques camera+sharing;");
  settings = SharingBy("camera+mutations");
  settings.crop = PixelRect{0, 0, 8, 8};
  expect_refused(settings, "remove the crop");
  settings = SharingBy("camera+sharing");
  settings.light_samples = 4;
  expect_refused(settings, "remove --light-samples");
  settings = SharingBy("camera+sharing");
  settings.outputs.Add(Aov::kUv);
  expect_refused(settings, "remove the outputs");
}

}  // namespace
}  // namespace sheaf
