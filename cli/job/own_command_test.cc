// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/own_command.h"

#include <gtest/gtest.h>

namespace sheaf::cli {
namespace {

TEST(OwnCommandTest, QuotesWhatAShellWouldInterpret) {
  EXPECT_EQ(CommandText({"submit", "a room.pbrt", "--samples", "64"}),
            "sheaf submit 'a room.pbrt' --samples 64");
  EXPECT_EQ(CommandText({"submit", "shot.####.pbrt"}), "sheaf submit 'shot.####.pbrt'");
}

TEST(OwnCommandTest, LeavesOutTheUsersOwnCommand) {
  EXPECT_EQ(CommandText({"submit", "--denoise-with", "clean --token=abc", "a.pbrt"}),
            "sheaf submit a.pbrt");
  EXPECT_EQ(CommandText({"submit", "--denoise-with=clean --token=abc", "a.pbrt"}),
            "sheaf submit a.pbrt");
}

}  // namespace
}  // namespace sheaf::cli
