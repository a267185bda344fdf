// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame/part_check.h"

#include <cmath>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

constexpr PixelRect kRect{0, 0, 4, 2};

// Samples with values far apart, some of them of a spectral color with a negative component.
FilmTile MakePart(float filter_weight = 1) {
  FilmTile part(kRect, {0, 64});
  PixelAccumulator accumulator(&part);
  for (int32_t y = kRect.y0; y < kRect.y1; ++y) {
    for (int32_t x = kRect.x0; x < kRect.x1; ++x) {
      accumulator.Begin(x, y);
      for (uint64_t i = 0; i < 64; ++i) {
        FilmSample sample;
        const float bright = i % 7 == 0 ? 1e4F : 0.1F;
        sample.radiance = {bright, 0.3F * bright, -0.1F * bright};
        sample.alpha = 1;
        sample.filter_weight = i % 3 == 0 ? filter_weight : 1;
        accumulator.Add(i, sample);
      }
      accumulator.End();
    }
  }
  return part;
}

void Scale(FilmTile* part, FilmChannel channel, float factor) {
  for (size_t p = 0; p < part->plane_size(); ++p) part->channel(channel)[p] *= factor;
}

TEST(PartCheckTest, RenderedPartsPass) {
  EXPECT_EQ(WhyNotOfSettings(MakePart(), {}), "");
  EXPECT_EQ(WhyNotOfSettings(MakePart(-0.1F), {}), "");
  EXPECT_EQ(WhyNotOfSettings(FilmTile(kRect, {0, 64}), {}), "") << "pixels that are not rendered";
}

TEST(PartCheckTest, CoverageIsBounded) {
  FilmTile part = MakePart();
  part.channel(FilmChannel::kAlpha)[3] = 64.1F;
  EXPECT_THAT(WhyNotOfSettings(part, {}), HasSubstr("alpha"));
  part.channel(FilmChannel::kAlpha)[3] = -1;
  EXPECT_THAT(WhyNotOfSettings(part, {}), HasSubstr("alpha"));
  FilmTile weighted = MakePart(-0.1F);
  weighted.channel(FilmChannel::kAlpha)[3] = -1;
  EXPECT_EQ(WhyNotOfSettings(weighted, {}), "") << "negative weights allow it";
}

TEST(PartCheckTest, ClampedSamplesAreBounded) {
  FrameSettings settings;
  settings.max_component_value = 1e4F;
  EXPECT_EQ(WhyNotOfSettings(MakePart(), settings), "");
  settings.max_component_value = 100;
  EXPECT_THAT(WhyNotOfSettings(MakePart(), settings), HasSubstr("maxcomponentvalue of 100"));
  settings.sensor = "nikon_d850";
  EXPECT_EQ(WhyNotOfSettings(MakePart(), settings), "") << "its responses are not known here";
}

TEST(PartCheckTest, ReplicatesAddUpToTheSums) {
  FilmTile part = MakePart();
  Scale(&part, FilmChannel::kRedHi, 1.05F);
  EXPECT_THAT(WhyNotOfSettings(part, {}), HasSubstr("replicates differ"));
  part = MakePart();
  part.replicate(3, 3)[0] += 2;
  EXPECT_THAT(WhyNotOfSettings(part, {}), HasSubstr("in weight"));
  part = MakePart();
  part.channel(FilmChannel::kBlueHi)[1] = std::fabs(part.channel(FilmChannel::kBlueHi)[1]);
  EXPECT_THAT(WhyNotOfSettings(part, {}), HasSubstr("replicates differ"));
}

}  // namespace
}  // namespace sheaf::coordinator
