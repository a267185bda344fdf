// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame/check_choice.h"

#include <cmath>

#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

constexpr PixelRect kCheckedTile{0, 0, 32, 32};

TEST(CheckChoiceTest, DrawsAreEvenAndStay) {
  const CheckChoice choice("secret");
  constexpr int kCount = 20'000;
  int low = 0, tiny = 0;
  for (int i = 0; i < kCount; ++i) {
    const SampleBlock block{static_cast<uint64_t>(i) * 16, 16};
    const double draw = choice.DrawOf("digest", kCheckedTile, block, {});
    ASSERT_GE(draw, 0);
    ASSERT_LT(draw, 1);
    EXPECT_EQ(choice.DrawOf("digest", kCheckedTile, block, {}), draw);
    low += draw < 0.25 ? 1 : 0;
    tiny += draw < 0.02 ? 1 : 0;
  }
  // Within five standard deviations.
  EXPECT_NEAR(low, 0.25 * kCount, 5 * std::sqrt(0.25 * 0.75 * kCount));
  EXPECT_NEAR(tiny, 0.02 * kCount, 5 * std::sqrt(0.02 * 0.98 * kCount));
}

TEST(CheckChoiceTest, DrawsDependOnSecretAndTask) {
  const double draw = CheckChoice("a").DrawOf("digest", kCheckedTile, {0, 16}, {});
  EXPECT_NE(CheckChoice("b").DrawOf("digest", kCheckedTile, {0, 16}, {}), draw);
  EXPECT_NE(CheckChoice("a").DrawOf("other", kCheckedTile, {0, 16}, {}), draw);
  EXPECT_NE(CheckChoice("a").DrawOf("digest", {0, 0, 32, 31}, {0, 16}, {}), draw);
  EXPECT_NE(CheckChoice("a").DrawOf("digest", kCheckedTile, {0, 32}, {}), draw);
  EXPECT_NE(CheckChoice("a").DrawOf("digest", kCheckedTile, {0, 16}, {8, 3}), draw);
  EXPECT_NE(CheckChoice("a").DrawOf("digest", kCheckedTile, {0, 16}, {}, TaskKind::kLight), draw);
}

}  // namespace
}  // namespace sheaf::coordinator
