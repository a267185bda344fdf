// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/command_line/name_hint.h"

#include <gtest/gtest.h>

namespace sheaf {
namespace {

TEST(NameHintTest, KnowsTheWordsOfOtherPrograms) {
  EXPECT_EQ(NameHint("--spp", {"--fps", "--samples"}), "; did you mean \"--samples\"?");
  EXPECT_EQ(NameHint("--spp", {"--spd"}), "; did you mean \"--spd\"?");
  EXPECT_EQ(NameHint("--outfile", {"--output"}), "; did you mean \"--output\"?");
  EXPECT_EQ(NameHint("jobs", {"list", "show"}), "; did you mean \"list\"?");
  EXPECT_EQ(NameHint("--name", {"--time", "--title"}), "; did you mean \"--title\"?");
  EXPECT_EQ(NameHint("--gpu", {"--fps", "--samples"}), "");
  EXPECT_EQ(NameHint("nonsense", {"list", "show"}), "");
}

}  // namespace
}  // namespace sheaf
