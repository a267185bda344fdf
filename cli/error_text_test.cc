// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/error_text.h"

#include <gtest/gtest.h>

namespace sheaf::cli {
namespace {

// As dashboard/src/format.ts writes them.
TEST(ErrorTextTest, ErrorsAreTheRootOfRelMse) {
  EXPECT_EQ(FormatPixelError(0.02), "±14 %");
  EXPECT_EQ(FormatPixelError(0.0009), "±3.0 %");
  EXPECT_EQ(FormatPixelError(2e-5), "±0.45 %");
  EXPECT_EQ(FormatPixelError(0), "±0 %");
  EXPECT_EQ(FormatBothErrors(0.0004), "±2.0 % (relMSE 0.0004)");
}

TEST(ErrorTextTest, WordsFollowTheError) {
  EXPECT_STREQ(NoiseWords(0.1), "a rough preview");
  EXPECT_STREQ(NoiseWords(0.02), "strong noise");
  EXPECT_STREQ(NoiseWords(0.0025), "visible noise");
  EXPECT_STREQ(NoiseWords(0.0004), "fine grain");
  EXPECT_STREQ(NoiseWords(1e-5), "hardly any noise");
}

}  // namespace
}  // namespace sheaf::cli
