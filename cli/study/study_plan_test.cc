// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/study_plan.h"

#include <gtest/gtest.h>

namespace sheaf::cli {
namespace {

// A frame of full HD, with light paths in 11 of 12 settings.
StudyCosts CostsOfLight(double minutes) {
  return {.minutes = minutes,
          .seconds_per_tile = 0.002,
          .seconds_per_light_path = 5e-7,
          .frame_pixels = 1920 * 1080,
          .tile_count = 120 * 68,
          .setting_count = 12,
          .light_setting_count = 11};
}

TEST(StudyPlanTest, AStudyWithoutLightPathsHasNoLightPasses) {
  StudyCosts costs = CostsOfLight(10);
  costs.light_setting_count = 0;
  const absl::StatusOr<StudyPlan> plan = PlanStudy(costs);
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->shrink, 0);
  EXPECT_EQ(plan->light_reference_blocks, 0u);
  EXPECT_EQ(plan->crops.blocks.size(), 4u);
}

// The ladder's samples and light paths together take its part of the time.
TEST(StudyPlanTest, LightPathsAreAsManyAsSamples) {
  const StudyCosts costs = CostsOfLight(10);
  const absl::StatusOr<StudyPlan> plan = PlanStudy(costs);
  ASSERT_TRUE(plan.ok()) << plan.status();
  const double pixels = 256 * static_cast<double>(plan->tile_count);
  const double small = static_cast<double>(costs.frame_pixels) / (plan->shrink * plan->shrink);
  EXPECT_GT(plan->shrink, 1);
  EXPECT_LT(small, 1.6 * pixels);
  EXPECT_GT(small, 0.4 * pixels);
  const double blocks = static_cast<double>(plan->blocks);
  const double seconds =
      blocks * (12 * static_cast<double>(plan->tile_count) * costs.seconds_per_tile +
                11 * 16 * small * costs.seconds_per_light_path);
  EXPECT_LT(seconds, 1.2 * kLadderFraction * 600);
  EXPECT_GT(seconds, 0.3 * kLadderFraction * 600);
}

// Crops show light passes of the frame itself, and never more than the reference has.
TEST(StudyPlanTest, CropsHaveNoMoreSamplesThanThereAreLightPasses) {
  // 16 passes take 16.6 s, and half of the reference's time is 81 s.
  const absl::StatusOr<StudyPlan> plan = PlanStudy(CostsOfLight(10));
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->light_reference_blocks, 4u);
  EXPECT_EQ(plan->crops.blocks, (std::vector<uint64_t>{1, 2, 4}));
}

TEST(StudyPlanTest, ALargeFrameNeedsTimeForABlockOfLightPasses) {
  const absl::StatusOr<StudyPlan> plan = PlanStudy(CostsOfLight(0.9));
  ASSERT_FALSE(plan.ok());
  EXPECT_EQ(plan.status(),
            absl::ResourceExhaustedError(
                "0.9 minutes are too few for light paths, which reach every pixel: 16 light passes "
                "of the frame take 17 s; give --minutes 2"));
  EXPECT_TRUE(PlanStudy(CostsOfLight(2)).ok());
}

TEST(StudyPlanTest, ASmallFrameIsNotShrunk) {
  EXPECT_EQ(ShrinkTo(1 << 20, 1 << 16), 1);
  EXPECT_EQ(ShrinkTo(1 << 14, 1 << 16), 2);
  EXPECT_EQ(ShrinkTo(1, 1 << 16), 16);  // kLightPixelsMin.
}

}  // namespace
}  // namespace sheaf::cli
