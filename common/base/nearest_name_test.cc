// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/nearest_name.h"

#include <gtest/gtest.h>

namespace sheaf {
namespace {

TEST(NearestNameTest, SuggestsTheNearestName) {
  const std::vector<std::string> names = {"render", "refine", "resume", "diffuse", "--samples"};
  EXPECT_EQ(NearestNameHint("rendr", names), "; did you mean \"render\"?");
  EXPECT_EQ(NearestNameHint("difuse", names), "; did you mean \"diffuse\"?");
  EXPECT_EQ(NearestNameHint("--sample", names), "; did you mean \"--samples\"?");
  EXPECT_EQ(NearestNameHint("rbg", {"auto", "rgb"}), "; did you mean \"rgb\"?") << "a swap";
  EXPECT_EQ(NearestNameHint("nonsense", names), "");
  EXPECT_EQ(NearestNameHint("--prio", {"--ocio", "--priority-group", "--priority"}),
            "; did you mean \"--priority\"?");
  EXPECT_EQ(NearestNameHint("--f", {"--frames"}), "") << "too short to say";
  EXPECT_EQ(NearestNameHint("render", {}), "");
  EXPECT_EQ(NearestNameHint(std::string(1000, 'x'), names), "") << "too long to compare";
}

}  // namespace
}  // namespace sheaf
