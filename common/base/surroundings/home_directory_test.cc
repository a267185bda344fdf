// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/surroundings/home_directory.h"

#include <gtest/gtest.h>
#include <pwd.h>
#include <unistd.h>

#include <cstdlib>

namespace sheaf {
namespace {

TEST(HomeDirectoryTest, IsAbsoluteWhateverTheVariableSays) {
  const char* before = std::getenv("HOME");
  const std::string kept = before == nullptr ? "" : before;
  const passwd* user = ::getpwuid(::getuid());
  const std::string listed = user == nullptr ? "" : user->pw_dir;
  setenv("HOME", "/home/anna", 1);
  EXPECT_EQ(HomeDirectory(), "/home/anna");
  setenv("HOME", "anna", 1);
  EXPECT_EQ(HomeDirectory(), listed);
  setenv("HOME", "", 1);
  EXPECT_EQ(HomeDirectory(), listed);
  unsetenv("HOME");
  EXPECT_EQ(HomeDirectory(), listed);
  if (before != nullptr) setenv("HOME", kept.c_str(), 1);
}

}  // namespace
}  // namespace sheaf
