// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests the measurement that decides whether the paths of a frame count in several pixels.
#include "worker/render/ablation/sharing_measurement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/technique_scenes.h"
#include "tests/support/test_scene.h"
#include "worker/render/ablation/technique_measurement.h"

namespace sheaf::render {
namespace {

using ::testing::HasSubstr;

constexpr TechniqueSet kFilterShared{Technique::kSharing};
constexpr TechniqueSet kViewsShared{Technique::kSharing, Technique::kViews};

SharingMeasurement MeasuredSharing(const TestScene& t, const FrameSettings& settings) {
  TableFileSource files({});
  EXPECT_TRUE(MayShare(settings));
  const absl::StatusOr<SharingMeasurement> measured = MeasureSharing(t.scene, settings, files);
  EXPECT_TRUE(measured.ok()) << measured.status();
  return measured.ok() ? *measured : SharingMeasurement{};
}

void SetFilter(FilterDescription::Kind kind, float radius_px, TestScene* t) {
  t->scene.filter.kind = kind;
  t->scene.filter.radius_x_px = t->scene.filter.radius_y_px = radius_px;
}

// Paths of a box filter of one pixel count in one pixel, and sharing has a price.
TEST(SharingMeasurementTest, NothingIsSharedThroughAFilterOfOnePixel) {
  TestScene t = Diffuse({1});
  SetFilter(FilterDescription::Kind::kBox, 0.5f, &t);
  const SharingMeasurement measured = MeasuredSharing(t, SquareSettings(64, 16, 4));
  EXPECT_NEAR(measured.sharing.gain, 1 / 1.35, 0.15);
  EXPECT_FALSE(measured.views.has_value());
  EXPECT_EQ(measured.Best(), TechniqueSet::kCamera);
  EXPECT_EQ(measured.Gain(), 1);
  EXPECT_EQ(FormatSharingMeasurement(measured).find("alike"), std::string::npos);
}

TEST(SharingMeasurementTest, WideFiltersShare) {
  TestScene t = Diffuse({1});
  SetFilter(FilterDescription::Kind::kGaussian, 1.5f, &t);
  const SharingMeasurement measured = MeasuredSharing(t, SquareSettings(64, 16, 4));
  EXPECT_GT(measured.sharing.gain, 1.5);
  EXPECT_LT(measured.sharing.gain, 4);
  EXPECT_LT(measured.sharing.least, measured.sharing.gain);
  EXPECT_EQ(measured.Best(), kFilterShared);
  EXPECT_THAT(FormatSharingMeasurement(measured), HasSubstr("noise of neighboring pixels"));
}

// A path counts in all pixels over which the camera moves; a small blur gives it few more.
TEST(SharingMeasurementTest, ViewsPayWhereTheBlurIsLarge) {
  for (const bool moves : {true, false}) {
    TestScene t = Diffuse({1});
    SetFilter(FilterDescription::Kind::kGaussian, 1.5f, &t);
    t.scene.camera.lens_radius = 1e-3f;
    t.scene.camera.focal_distance = 3;
    t.scene.camera.shutter_close = 1;
    TransformOverTime& camera = t.scene.camera.world_from_camera;
    if (moves) camera.end = TranslateMatrix({0.6, 0, 0}) * camera.start;
    const SharingMeasurement measured = MeasuredSharing(t, SquareSettings(256, 256, 4));
    ASSERT_TRUE(measured.views.has_value());
    EXPECT_EQ(measured.Best(), moves ? kViewsShared : kFilterShared)
        << FormatSharingMeasurement(measured);
    EXPECT_EQ(measured.Gain(), moves ? measured.views->gain : measured.sharing.gain);
  }
}

TEST(SharingMeasurementTest, BothEyesAreMeasuredTogether) {
  TestScene t = Diffuse({1});
  SetFilter(FilterDescription::Kind::kBox, 0.5f, &t);
  FrameSettings settings = SquareSettings(64, 16, 4);
  settings.width_px *= 2;
  settings.window.x1 *= 2;
  settings.eye_distance = 0.1f;
  const SharingMeasurement measured = MeasuredSharing(t, settings);
  EXPECT_EQ(measured.width_px, 2 * measured.height_px);
  EXPECT_EQ(measured.Best(), TechniqueSet::kCamera);
}

TEST(SharingMeasurementTest, OtherFramesMayNotShare) {
  FrameSettings settings = SquareSettings(16, 16, 4);
  EXPECT_TRUE(MayShare(settings));
  settings.outputs.Add(Aov::kUv);
  EXPECT_FALSE(MayShare(settings));
  settings = SquareSettings(16, 16, 4);
  settings.window.x1 = 8;
  EXPECT_FALSE(MayShare(settings));
  settings = SquareSettings(16, 16, 4);
  settings.one_sequence = true;
  EXPECT_FALSE(MayShare(settings));
}

}  // namespace
}  // namespace sheaf::render
