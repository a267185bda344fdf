// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/label.h"

#include "gtest/gtest.h"

namespace sheaf {
namespace {

TEST(LabelTest, AreShortAndPrintable) {
  for (const char* label : {"a", "gpu-free", "anna@example.org", "Comet_2.1"}) {
    EXPECT_EQ(WhyNoLabel(label), "") << label;
  }
  EXPECT_EQ(WhyNoLabel(std::string(kLabelBytesMax, 'x')), "");
  EXPECT_NE(WhyNoLabel(std::string(kLabelBytesMax + 1, 'x')), "");
  for (const char* text : {"", "a b", "a:b", "a\n", "\xc3\xa4", "a/b"}) {
    EXPECT_NE(WhyNoLabel(text), "") << text;
  }
}

}  // namespace
}  // namespace sheaf
