// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/error/eye_errors.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <string>

#include "common/film/film.h"

namespace sheaf {
namespace {

constexpr PixelRect kEyes{0, 0, 16, 8};
constexpr uint64_t kEyeSamples = 64;

// A value without structure in [-0.5, 0.5). Source: Steele et al. 2014, SplitMix64.
float Noise(uint64_t key) {
  key = (key + 1) * 0x9e3779b97f4a7c15;
  key = (key ^ (key >> 30)) * 0xbf58476d1ce4e5b9;
  key = (key ^ (key >> 27)) * 0x94d049bb133111eb;
  return static_cast<float>((key ^ (key >> 31)) >> 40) * 0x1p-24f - 0.5f;
}

// A gray image of both eyes; the right eye has the left one's noise times `shared`, and noise of
// its own times `own`.
FrameImage ImageOf(float shared, float own) {
  FilmTile tile(kEyes, {0, kEyeSamples});
  PixelAccumulator accumulator(&tile);
  const int32_t half = kEyes.x1 / 2;
  for (int32_t y = 0; y < kEyes.y1; ++y) {
    for (int32_t x = 0; x < kEyes.x1; ++x) {
      accumulator.Begin(x, y);
      for (uint64_t n = 0; n < kEyeSamples; ++n) {
        const auto pixel = static_cast<uint64_t>(y * half + x % half);
        const float left = Noise(pixel * kEyeSamples + n);
        const float alone = Noise((pixel + 1000) * kEyeSamples + n);
        FilmSample sample;
        sample.radiance = Rgb::Gray(2 + (x < half ? left : shared * left + own * alone));
        accumulator.Add(n, sample);
      }
      accumulator.End();
    }
  }
  FrameImage image = MakeFrameImage(kEyes, kEyes.x1, kEyes.y1);
  AddEyeDifference(&image);
  DevelopTile(tile, &image);
  return image;
}

TEST(EyeErrorsTest, TheDifferenceCountsWhatTheEyesShare) {
  const FrameImage same = ImageOf(1, 0), opposite = ImageOf(-1, 0), independent = ImageOf(0, 1);
  const std::string channel = std::string(kEyeDifferenceLayer) + ".G";
  for (size_t p = 0; p < same.planes[0].size(); ++p) {
    const float of_eye = (*same.Find("stderr.G"))[p];
    EXPECT_GT(of_eye, 0);
    EXPECT_NEAR((*same.Find(channel))[p], 0, 1e-6f);
    EXPECT_NEAR((*opposite.Find(channel))[p], 2 * of_eye, 1e-5f);
  }
  EXPECT_NEAR(EstimateEyeErrors(same).difference.RelativeMse(), 0, 1e-9);
  for (const auto& [image, expected, tolerance] :
       {std::tuple{&opposite, 4.0, 1e-3}, std::tuple{&independent, 2.0, 0.2}}) {
    const EyeErrors errors = EstimateEyeErrors(*image);
    const double of_eye = (errors.left.RelativeMse() + errors.right.RelativeMse()) / 2;
    EXPECT_NEAR(errors.difference.RelativeMse() / of_eye, expected, tolerance);
  }
}

TEST(EyeErrorsTest, TheWorseEyeStandsForBoth) {
  const EyeErrors errors = EstimateEyeErrors(ImageOf(0, 2));
  EXPECT_GT(errors.right.RelativeMse(), 3 * errors.left.RelativeMse());
  const ErrorSums worse = errors.OfWorse();
  EXPECT_EQ(worse.pixel_count, kEyes.PixelCount());
  EXPECT_DOUBLE_EQ(worse.RelativeMse(), errors.right.RelativeMse());
  EXPECT_NEAR(worse.Deviation() / errors.right.Deviation(), 1, 1e-9);
  EXPECT_EQ(EstimateEyeErrors(ImageOf(0, 0)).OfWorse().RelativeMse(),
            EstimateEyeErrors(ImageOf(0, 0)).left.RelativeMse());
}

}  // namespace
}  // namespace sheaf
