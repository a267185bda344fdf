// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/quote/denoised_errors.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/film/denoised_output.h"

namespace sheaf::cli {
namespace {

TEST(DenoisedErrorsTest, CropsAreInsideAndApart) {
  for (const PixelRect& window : {PixelRect{0, 0, 1920, 1080}, PixelRect{100, 50, 740, 530}}) {
    const std::vector<PixelRect> crops = DenoisedCrops(window);
    ASSERT_EQ(crops.size(), 4u);
    int64_t pixels = 0;
    for (size_t i = 0; i < crops.size(); ++i) {
      const PixelRect& crop = crops[i];
      EXPECT_GE(crop.Width(), kDenoisedCropPxMin);
      EXPECT_LE(crop.Width(), kDenoisedCropPxMax);
      EXPECT_EQ(crop.Width(), crop.Height());
      EXPECT_GT(crop.x0, window.x0);
      EXPECT_GT(crop.y0, window.y0);
      EXPECT_LT(crop.x1, window.x1);
      EXPECT_LT(crop.y1, window.y1);
      for (size_t k = 0; k < i; ++k) {
        EXPECT_TRUE(crop.x0 >= crops[k].x1 || crop.y0 >= crops[k].y1);
      }
      pixels += crop.PixelCount();
    }
    EXPECT_LE(static_cast<double>(pixels),
              kDenoisedCropShare * static_cast<double>(window.PixelCount()));
  }
  EXPECT_TRUE(DenoisedCrops({0, 0, 400, 300}).empty()) << "too few pixels";
  EXPECT_TRUE(DenoisedCrops({0, 0, 100000, 40}).empty()) << "too low";
}

// A crop of even light and noise.
FrameImage CropOf(float light, float error, float denoised_error) {
  FilmOutputs outputs;
  AddDenoised(&outputs);
  FrameImage image = MakeFrameImage({0, 0, 16, 16}, 64, 64, outputs);
  for (const char* component : {"R", "G", "B"}) {
    const auto fill = [&](const std::string& layer, float value) {
      std::vector<float>& plane = *image.Find(layer + component);
      plane.assign(plane.size(), value);
    };
    fill("", light);
    fill("stderr.", error);
    fill(absl::StrCat(kDenoisedLayer, "."), light);
    fill(absl::StrCat(kDenoisedErrorLayer, "."), denoised_error);
  }
  image.Find("samples")->assign(256, 16);
  return image;
}

TEST(DenoisedErrorsTest, ErrorsAreMeansOverCrops) {
  const std::vector<FrameImage> crops = {CropOf(2, 0.2f, 0.1f), CropOf(4, 0.4f, 0.1f),
                                         CropOf(0, 0, 0)};
  const DenoisedPilot pilot = DenoisedErrors(crops);
  // A dark crop tells nothing. relMSE divides by 1.01 times the square of the light.
  EXPECT_NEAR(pilot.image, 0.01 / 1.01, 1e-3);
  EXPECT_NEAR(pilot.Gain(), 2 * 0.01 / (0.01 / 4 + 0.01 / 16), 1e-5);
  EXPECT_EQ(DenoisedErrors({}).Gain(), 1);
  // One pixel has all of the image's error, and is as bright as the others: it counts where the
  // denoised layer's error is spread.
  FrameImage spot = CropOf(2, 0, 0.1f);
  for (const char* channel : {"stderr.R", "stderr.G", "stderr.B"}) (*spot.Find(channel))[119] = 3;
  double shares = 0;  // The spot's shares in the means of a line.
  for (int x = 0; x < 16; ++x) shares += 1.0 / (std::min(16, x + 9) - std::max(0, x - 8));
  EXPECT_NEAR(DenoisedErrors({&spot, 1}).Gain(), shares * shares * 9 / (256 * 0.01), 1e-4);
}

TEST(DenoisedErrorsTest, ImageErrorsLieBetweenNoGainAndThePilots) {
  const DenoisedPilot pilot{0.6, 0.1};
  for (const double target : {0.5, 0.1, 0.02, 1e-3, 1e-8}) {
    const coordinator::Estimate error = ImageErrorFor(target, pilot);
    EXPECT_EQ(error.low, target);
    EXPECT_NEAR(error.high, 6 * target, 1e-12);
    EXPECT_GE(error.value, error.low);
    EXPECT_LE(error.value, error.high);
  }
  EXPECT_NEAR(ImageErrorFor(0.1, pilot).value, 0.6, 1e-12) << "the pilot itself";
  // Sixteen times the samples.
  EXPECT_NEAR(ImageErrorFor(0.1 / std::pow(16, kDenoisedRate), pilot).value, 0.6 / 16, 1e-12);
  EXPECT_EQ(ImageErrorFor(1e-8, pilot).value, 1e-8) << "nothing is left to denoise";
  EXPECT_EQ(ImageErrorFor(0.02, {0.1, 0.2}).value, 0.02);
  EXPECT_EQ(ImageErrorFor(0.02, {}).high, 0.02);
}

}  // namespace
}  // namespace sheaf::cli
