// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/text/shell_quoted.h"

#include <gtest/gtest.h>

namespace sheaf {
namespace {

TEST(ShellQuotedTest, OnlyTextThatAShellInterpretsIsQuoted) {
  EXPECT_EQ(ShellQuoted("out/a.exr"), "out/a.exr");
  EXPECT_EQ(ShellQuoted("a b.####.exr"), "'a b.####.exr'");
  EXPECT_EQ(ShellQuoted("it's"), "'it'\\''s'");
  EXPECT_EQ(ShellQuoted(""), "''");
}

}  // namespace
}  // namespace sheaf
