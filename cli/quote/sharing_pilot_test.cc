// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/quote/sharing_pilot.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "common/film/frame_image.h"
#include "common/scene/settings/render_settings.h"

namespace sheaf::cli {
namespace {

constexpr PixelRect kSmallEye{0, 0, 8, 6}, kSmallEyes{0, 0, 16, 6};

// A gray image with the same standard error in all pixels of each half.
PilotOutput OutputOf(PixelRect window, float left_error, float right_error, double cpu_seconds) {
  PilotOutput output{MakeFrameImage(window, window.x1, window.y1), cpu_seconds};
  for (const char* component : {"R", "G", "B"}) {
    std::vector<float>& value = *output.image.Find(component);
    std::vector<float>& error = *output.image.Find(std::string("stderr.") + component);
    for (size_t p = 0; p < value.size(); ++p) {
      value[p] = 1;
      error[p] = p % static_cast<size_t>(window.x1) < 8 ? left_error : right_error;
    }
  }
  output.image.Find("samples")->assign(output.image.planes[0].size(), 64);
  return output;
}

TEST(SharingPilotTest, PlainFramesAreOfTheScenesCamera) {
  FrameSettings settings;
  settings.width_px = 200;
  settings.height_px = 50;
  settings.window = {0, 0, 200, 50};
  settings.eye_distance = 0.1f;
  settings.eye_convergence = 2;
  settings.techniques = TechniqueSet{Technique::kSharing, Technique::kViews};
  const FrameSettings plain = WithoutSharing(settings);
  EXPECT_FALSE(plain.IsStereo());
  EXPECT_EQ(plain.eye_convergence, 0);
  EXPECT_EQ(plain.window, (PixelRect{0, 0, 100, 50}));
  EXPECT_EQ(plain.width_px, 100);
  EXPECT_EQ(plain.techniques, TechniqueSet::kCamera);
}

TEST(SharingPilotTest, TheWorseEyeDecides) {
  PilotOutput eyes = OutputOf(kSmallEyes, 0.05f, 0.1f, 3);
  AddEyeDifference(&eyes.image);
  const PilotOutput plain = OutputOf(kSmallEye, 0.2f, 0.2f, 2);
  const SharingGain gain = GainOf(eyes, plain);
  EXPECT_NEAR(gain.error_ratio, 0.25, 0.02);
  EXPECT_DOUBLE_EQ(gain.cpu_ratio, 1.5);
  EXPECT_GT(gain.log_error_deviation, 0);
  const SharingGain unknown =
      GainOf(OutputOf(kSmallEye, 0, 0, 0), OutputOf(kSmallEye, 0.2f, 0.2f, 2));
  EXPECT_EQ(unknown.error_ratio, 1);
  EXPECT_EQ(unknown.cpu_ratio, 1);
}

TEST(SharingPilotTest, AFrameHasOneCell) {
  coordinator::ErrorModel model;
  model.cells.push_back({{16, {10, 1, 0.25}}, 2});
  model.cells.push_back({{16, {20, 3, 0.75}}, 4});
  model.log_error_deviation = 0.3;
  ApplySharing({.error_ratio = 0.5, .cpu_ratio = 1.5, .log_error_deviation = 0.4}, &model);
  ASSERT_EQ(model.cells.size(), 1u);
  const coordinator::ForecastCell& cell = model.cells[0];
  EXPECT_EQ(cell.measured.samples, 16u);
  EXPECT_EQ(cell.measured.error.pixel_count, 30);
  EXPECT_DOUBLE_EQ(cell.measured.error.sum, 2);
  EXPECT_DOUBLE_EQ(cell.measured.error.square_sum, 0.25);
  EXPECT_DOUBLE_EQ(cell.cpu_seconds_per_sample, 9);
  EXPECT_DOUBLE_EQ(model.log_error_deviation, 0.5);
}

}  // namespace
}  // namespace sheaf::cli
