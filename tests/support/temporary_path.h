// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Paths for files that tests write.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <string>

namespace sheaf::testing {

// A path in the system's temporary folder that no concurrent test receives.
inline std::string TemporaryPath(const std::string& name) {
  const ::testing::TestInfo* test = ::testing::UnitTest::GetInstance()->current_test_info();
  std::string test_name = test != nullptr ? test->name() : "";
  std::replace(test_name.begin(), test_name.end(), '/', '-');  // Before the parameter's number.
  return ::testing::TempDir() + "sheaf-" + std::to_string(getpid()) + "-" + test_name + "-" + name;
}

}  // namespace sheaf::testing
