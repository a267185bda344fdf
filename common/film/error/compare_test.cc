// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/error/compare.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace sheaf {
namespace {

FrameImage MakeEvenImage(PixelRect window, float value, float error) {
  FrameImage image = MakeFrameImage(window, window.x1, window.y1);
  for (const char* c : {"R", "G", "B"}) image.Find(c)->assign(image.planes[0].size(), value);
  for (const char* c : {"stderr.R", "stderr.G", "stderr.B"}) {
    image.Find(c)->assign(image.planes[0].size(), error);
  }
  return image;
}

TEST(CompareTest, FollowsTheDefinitions) {
  FrameImage reference = MakeEvenImage({0, 0, 2, 1}, 0, 0), image = reference;
  *reference.Find("R") = {1, 3};
  *reference.Find("G") = {2, 2};
  *image.Find("R") = {1, 4};
  *image.Find("G") = {1, 2};
  const absl::StatusOr<Comparison> c = CompareImages(reference, image);
  ASSERT_TRUE(c.ok());
  const double mean = 8.0 / 6, floor = 0.01 * mean * mean;
  EXPECT_NEAR(c->mse, 2.0 / 6, 1e-15);
  EXPECT_NEAR(c->relative_mse, (1 / (9 + floor) + 1 / (4 + floor)) / 6, 1e-15);
  EXPECT_NEAR(c->reference_mean, mean, 1e-15);
  EXPECT_NEAR(c->image_mean, mean, 1e-15);
  EXPECT_NEAR(c->mean_ratio[0], 5.0 / 4, 1e-15);
  EXPECT_NEAR(c->mean_ratio[1], 3.0 / 4, 1e-15);
  EXPECT_EQ(c->mean_ratio[2], 1);
  EXPECT_EQ(c->fraction_differing, 1);
  EXPECT_EQ(c->max_abs_difference, 1);
}

TEST(CompareTest, EqualImagesDoNotDifferEvenBlackOnes) {
  const FrameImage black = MakeEvenImage({0, 0, 3, 3}, 0, 0);
  const absl::StatusOr<Comparison> c = CompareImages(black, black);
  ASSERT_TRUE(c.ok());
  EXPECT_EQ(c->relative_mse, 0);
  EXPECT_EQ(c->fraction_differing, 0);
  EXPECT_EQ(c->mean_ratio[0], 1);
}

TEST(CompareTest, OneDifferentBitCounts) {
  const FrameImage reference = MakeEvenImage({0, 0, 4, 4}, 1, 0);
  FrameImage image = reference;
  image.Find("B")->at(5) = std::nextafter(1.0f, 2.0f);
  EXPECT_EQ(CompareImages(reference, image)->fraction_differing, 1.0 / 16);
}

TEST(CompareTest, NonFiniteValuesAreCountedSeparately) {
  const FrameImage reference = MakeEvenImage({0, 0, 4, 4}, 1, 0);
  FrameImage image = reference;
  image.Find("G")->at(0) = std::numeric_limits<float>::quiet_NaN();
  image.Find("R")->at(1) = std::numeric_limits<float>::infinity();
  const absl::StatusOr<Comparison> c = CompareImages(reference, image);
  ASSERT_TRUE(c.ok());
  EXPECT_EQ(c->nonfinite_count, 2u);
  EXPECT_EQ(c->mse, 0);
  EXPECT_EQ(c->fraction_differing, 2.0 / 16);
}

// The error message distinguishes the same color in other primaries from a different color.
TEST(CompareTest, DifferentPrimariesMustBeConverted) {
  FrameImage reference = MakeEvenImage({0, 0, 2, 2}, 0.5f, 0), image = reference;
  ASSERT_TRUE(ConvertColor(ChromaticitiesOf(Primaries::kAcesCg), &image).ok());
  EXPECT_EQ(CompareImages(reference, image).status().code(), absl::StatusCode::kInvalidArgument);
  ASSERT_TRUE(ConvertColor(image.color.chromaticities, &reference).ok());
  const absl::StatusOr<Comparison> c = CompareImages(reference, image);
  ASSERT_TRUE(c.ok());
  EXPECT_EQ(c->fraction_differing, 0);
  EXPECT_EQ(DifferenceImage(reference, image)->color.chromaticities,
            ChromaticitiesOf(Primaries::kAcesCg));
}

TEST(CompareTest, RefusesDifferentSizesAndMissingChannels) {
  const FrameImage a = MakeEvenImage({0, 0, 4, 4}, 1, 0), b = MakeEvenImage({0, 0, 4, 5}, 1, 0);
  EXPECT_TRUE(absl::IsInvalidArgument(CompareImages(a, b).status()));
  FrameImage gray = a;
  gray.channel_names[0] = "Y";
  EXPECT_TRUE(absl::IsInvalidArgument(CompareImages(a, gray).status()));
  FrameImage no_error = a;
  no_error.channel_names[12] = "other";
  EXPECT_TRUE(absl::IsInvalidArgument(FindTileDeviations(a, no_error, {}).status()));
}

TEST(CompareTest, NoiseAloneCausesNoTileDeviation) {
  constexpr float kSigma = 0.3f;
  const FrameImage reference = MakeEvenImage({32, 16, 32 + 160, 16 + 96}, 1, 0);
  FrameImage image = MakeEvenImage(reference.window, 1, kSigma);
  std::mt19937 bits(31);
  std::normal_distribution<float> noise(0, kSigma);
  for (const char* c : {"R", "G", "B"}) {
    for (float& v : *image.Find(c)) v += noise(bits);
  }
  TileDeviationLimits limits;
  limits.mean_fraction_max = 0;
  limits.standard_errors_max = 4.5;
  const absl::StatusOr<TileDeviations> clean = FindTileDeviations(reference, image, limits);
  ASSERT_TRUE(clean.ok());
  EXPECT_EQ(clean->tile_count, 60u);
  EXPECT_EQ(clean->deviating_count, 0u);
  EXPECT_EQ(clean->worst.size(), limits.worst_count_max);

  // A bias of half a pixel's noise, in one tile only, is 8 standard errors of its mean.
  for (int32_t y = 0; y < 16; ++y) {
    for (int32_t x = 0; x < 16; ++x) {
      image.Find("G")->at(static_cast<size_t>((y + 32) * 160 + x + 48)) += 0.5f * kSigma;
    }
  }
  const absl::StatusOr<TileDeviations> biased = FindTileDeviations(reference, image, limits);
  ASSERT_TRUE(biased.ok());
  EXPECT_EQ(biased->deviating_count, 1u);
  EXPECT_EQ(biased->worst[0].rect, (PixelRect{80, 48, 96, 64}));
  EXPECT_EQ(biased->worst[0].channel, 1u);
  EXPECT_NEAR(biased->worst[0].standard_error, kSigma / 16, 1e-6);
  EXPECT_NEAR(biased->worst[0].excess, 8, 4);
}

TEST(CompareTest, ToleranceAndReferenceNoiseAllowDifferences) {
  const FrameImage reference = MakeEvenImage({0, 0, 16, 16}, 1, 0);
  const FrameImage image = MakeEvenImage({0, 0, 16, 16}, 1.01f, 0.016f);  // Tile error 0.001.
  TileDeviationLimits limits;
  EXPECT_EQ(FindTileDeviations(reference, image, limits)->deviating_count, 0u);
  limits.mean_fraction_max = 0;
  EXPECT_NEAR(FindTileDeviations(reference, image, limits)->worst[0].excess, 10, 1e-3);
  limits.samples_ratio = 3;
  EXPECT_NEAR(FindTileDeviations(reference, image, limits)->worst[0].excess, 5, 1e-3);
  const FrameImage exact = MakeEvenImage({0, 0, 16, 16}, 1.01f, 0);
  EXPECT_EQ(FindTileDeviations(reference, exact, limits)->deviating_count, 1u);
}

TEST(CompareTest, DifferenceIsSigned) {
  const FrameImage reference = MakeEvenImage({8, 8, 12, 12}, 1, 0),
                   image = MakeEvenImage({8, 8, 12, 12}, 0.25f, 0);
  const absl::StatusOr<FrameImage> difference = DifferenceImage(reference, image);
  ASSERT_TRUE(difference.ok());
  EXPECT_EQ(difference->window, image.window);
  EXPECT_EQ(difference->Find("G")->at(3), -0.75f);
}

}  // namespace
}  // namespace sheaf
