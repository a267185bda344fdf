// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Linked into each test program: ::testing::TempDir() is a new folder of the process, which is
// removed at its end, so that tests that run at the same time cannot write each other's files.
#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <string>
#include <system_error>

namespace sheaf {
namespace {

class TemporaryFolder : public ::testing::Environment {
 public:
  void SetUp() override {
    std::string pattern = ::testing::TempDir() + "sheaf-test-XXXXXX";
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr) << pattern;
    path_ = pattern + "/";
    ::setenv("TEST_TMPDIR", path_.c_str(), 1);
  }
  void TearDown() override {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }

 private:
  std::string path_;
};

const ::testing::Environment* const registered =
    ::testing::AddGlobalTestEnvironment(new TemporaryFolder);

}  // namespace
}  // namespace sheaf
