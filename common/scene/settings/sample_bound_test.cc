// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/settings/sample_bound.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>

namespace sheaf {
namespace {

using ::testing::HasSubstr;

FrameSettings Clamped() {
  FrameSettings settings;
  settings.max_component_value = 10;
  settings.color = ColorTransport::kRgb;
  return settings;
}

std::string WhyNot(const std::function<void(FrameSettings*)>& change) {
  FrameSettings settings = Clamped();
  change(&settings);
  const SampleBound bound = SampleBoundOf(settings);
  return bound.most.has_value() ? "" : bound.reason;
}

// R is at most 1 / 0.4124 of X, G 1 / 0.7152 of Y and B 1 / 0.9505 of Z (IEC 61966-2-1).
TEST(SampleBoundTest, MaximumOfXyzBoundsRgb) {
  const SampleBound bound = SampleBoundOf(Clamped());
  ASSERT_TRUE(bound.most.has_value());
  EXPECT_NEAR((*bound.most)[0], 10 / 0.4124, 0.01);
  EXPECT_NEAR((*bound.most)[1], 10 / 0.7152, 0.01);
  EXPECT_NEAR((*bound.most)[2], 10 / 0.9505, 0.01);
  EXPECT_EQ(bound.reason, "X, Y and Z of a sample are at most 10");
}

TEST(SampleBoundTest, SaysWhyThereIsNone) {
  EXPECT_EQ(WhyNot([](FrameSettings*) {}), "");
  EXPECT_THAT(WhyNot([](FrameSettings* s) { s->max_component_value = 0; }), HasSubstr("--clamp"));
  EXPECT_THAT(WhyNot([](FrameSettings* s) { s->color = ColorTransport::kAuto; }),
              HasSubstr("--color rgb"));
  EXPECT_THAT(WhyNot([](FrameSettings* s) { s->sensor = "canon_eos_100d"; }), HasSubstr("sensor"));
  EXPECT_THAT(WhyNot([](FrameSettings* s) { s->primaries = Primaries::kRec2020; }),
              HasSubstr("converted"));
  EXPECT_THAT(WhyNot([](FrameSettings* s) { s->techniques = TechniqueSet::kCameraAndLight; }),
              HasSubstr("light paths"));
  EXPECT_THAT(WhyNot([](FrameSettings* s) { s->eye_distance = 0.1f; }),
              HasSubstr("several pixels"));
  EXPECT_THAT(WhyNot([](FrameSettings* s) { s->one_sequence = true; }), HasSubstr("replicates"));
  EXPECT_THAT(WhyNot([](FrameSettings* s) { s->lattice.stride_px = 2; }),
              HasSubstr("not rendered"));
}

}  // namespace
}  // namespace sheaf
