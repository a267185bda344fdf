// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/study_reference.h"

#include <gtest/gtest.h>

namespace sheaf::cli {
namespace {

// A tile of two gray pixels.
TilePixels Gray(float first, float second, float deviation = 0) {
  return {{{first, first, first}, {second, second, second}},
          {{deviation, deviation, deviation}, {deviation, deviation, deviation}}};
}

TEST(StudyReferenceTest, ErrorsAreRelativeAndWithoutTheReferencesOwn) {
  const StudyReference reference({Gray(1, 3, 0.1f)});
  EXPECT_EQ(reference.mean(), 2);
  const double first = 1 + 0.04, second = 9 + 0.04;
  const double own = 0.01 / first + 0.01 / second;
  EXPECT_NEAR(reference.RelativeMse(), own / 2, 1e-6);
  EXPECT_NEAR(reference.ErrorOf(0, Gray(1.5f, 3), false), 0.25 / first - own, 1e-6);
  EXPECT_NEAR(reference.VarianceOf(0, Gray(0, 0, 0.2f)), 0.04 / first + 0.04 / second, 1e-6);
}

// The smaller frame shows the light of both pixels in each. The compared image has the same light,
// so the blur is not an error; errors stay relative to the frame's light.
TEST(StudyReferenceTest, LightOfTheSmallerFrameIsComparedWithItself) {
  const StudyReference reference({Gray(1, 1)}, {Gray(2, 0)}, {Gray(1, 1)});
  EXPECT_EQ(reference.mean(), 2);
  EXPECT_NEAR(reference.ErrorOf(0, Gray(2, 2), true), 0, 1e-9);
  EXPECT_NEAR(reference.ErrorOf(0, Gray(2.5f, 2), true), 0.25 / 9.04, 1e-6);
  // An image without light paths has the frame's own light.
  EXPECT_NEAR(reference.ErrorOf(0, Gray(3, 1), false), 0, 1e-9);
  // It may also miss that light.
  EXPECT_NEAR(reference.ErrorOf(0, Gray(1, 1), false), 4 / 9.04, 1e-6);
}

TEST(StudyReferenceTest, VariancesOfCameraAndLightAddUp) {
  const StudyReference reference({Gray(1, 1, 0.3f)}, {Gray(0, 0, 0.4f)}, {Gray(0, 0, 0)});
  EXPECT_NEAR(reference.RelativeMse(), 0.25 / 1.01, 1e-6);
  EXPECT_NEAR(reference.ErrorOf(0, Gray(1, 1), false), -2 * 0.25 / 1.01, 1e-6);
  EXPECT_NEAR(reference.ErrorOf(0, Gray(1, 1), true), -2 * 0.09 / 1.01, 1e-6);
}

}  // namespace
}  // namespace sheaf::cli
