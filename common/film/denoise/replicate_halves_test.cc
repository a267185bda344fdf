// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/denoise/replicate_halves.h"

#include <gtest/gtest.h>

#include "common/film/film_test_samples.h"
#include "common/film/frame_image.h"

namespace sheaf {
namespace {

constexpr PixelRect kRect{2, 3, 5, 6};

FilmOutputs DenoisedOutputs() {
  FilmOutputs outputs;
  outputs.Add(Aov::kUv);
  outputs.light_groups = {"default"};
  AddDenoised(&outputs);
  return outputs;
}

FilmSample SampleAt(int32_t x, int32_t y, uint64_t n) {
  FilmSample sample = MakeTestSample(x, y, n);
  sample.filter_weight = 1;
  return sample;
}

FilmTile MakeTile(SampleBlock block) {
  const FilmOutputs outputs = DenoisedOutputs();
  FilmTile tile(kRect, block, outputs);
  PixelAccumulator accumulator(&tile);
  for (int32_t y = kRect.y0; y < kRect.y1; ++y) {
    for (int32_t x = kRect.x0; x < kRect.x1; ++x) {
      accumulator.Begin(x, y);
      for (uint64_t n = block.first; n < block.End(); ++n) {
        accumulator.Add(n, SampleAt(x, y, n), OutputSample(outputs));
      }
      accumulator.End();
    }
  }
  return tile;
}

// Each half has the means of its own samples.
TEST(ReplicateHalvesTest, HoldsMeansOfEvenAndOddSamples) {
  constexpr uint64_t kCount = 32;
  ReplicateHalves halves(kRect);
  halves.DevelopTile(MakeTile({0, kCount}), {});
  for (size_t h = 0; h < 2; ++h) {
    double light = 0, albedo = 0, alpha = 0, depth = 0;
    for (uint64_t n = h; n < kCount; n += 2) {
      const FilmSample sample = SampleAt(kRect.x0 + 1, kRect.y0, n);
      light += double{sample.radiance.g};
      albedo += double{sample.albedo.b};
      alpha += double{sample.alpha};
      depth += double{sample.depth};
    }
    const ReplicateHalves::Half& half = halves.half(h);
    EXPECT_NEAR(half.mean[1][1], light / 16, 1e-5);
    EXPECT_NEAR(half.guides[2][1], albedo / 16, 1e-5);
    EXPECT_NEAR(half.guides[6][1], alpha / 16, 1e-5);
    EXPECT_NEAR(half.guides[7][1], depth / alpha, 1e-4);
    EXPECT_EQ(half.replicate_count[1], 8);
    EXPECT_GT(half.variance[1][1], 0);
  }
  EXPECT_EQ(halves.even_share()[1], 0.5F);
}

// The guides' sums are those of the canonical tree, however samples were divided.
TEST(ReplicateHalvesTest, DoesNotDependOnHowSamplesWereDivided) {
  ReplicateHalves whole(kRect), merged(kRect);
  whole.DevelopTile(MakeTile({0, 32}), {});
  merged.DevelopTile(
      MergeSiblings(MakeTile({0, 16}), MergeSiblings(MakeTile({16, 8}), MakeTile({24, 8}))), {});
  for (size_t h = 0; h < 2; ++h) {
    EXPECT_EQ(whole.half(h).guides, merged.half(h).guides);
    EXPECT_EQ(whole.half(h).mean, merged.half(h).mean);
    EXPECT_EQ(whole.half(h).variance, merged.half(h).variance);
  }
}

TEST(ReplicateHalvesTest, AddsIndependentLight) {
  ReplicateHalves sum(kRect), one(kRect);
  sum.DevelopTile(MakeTile({0, 16}), {});
  one.DevelopTile(MakeTile({0, 16}), {});
  sum.Add(one);
  EXPECT_FLOAT_EQ(sum.half(1).mean[0][4], 2 * one.half(1).mean[0][4]);
  EXPECT_FLOAT_EQ(sum.half(1).variance[0][4], 2 * one.half(1).variance[0][4]);
  EXPECT_EQ(sum.half(1).guides, one.half(1).guides);
}

// The image has no channels of the guides' halves.
TEST(ReplicateHalvesTest, OutputsNameTheirLayers) {
  const FilmOutputs outputs = DenoisedOutputs();
  const FrameImage image = MakeFrameImage(kRect, 10, 10, outputs);
  EXPECT_NE(image.Find("denoised.R"), nullptr);
  EXPECT_NE(image.Find("denoisedError.B"), nullptr);
  EXPECT_EQ(image.Find("even.albedo.R"), nullptr);
  EXPECT_EQ(FormatOutputs(outputs), "uv,denoised,light:default");
  const auto parsed = ParseOutputs("uv,denoised,light:default");
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  EXPECT_TRUE(*parsed == outputs);
}

}  // namespace
}  // namespace sheaf
