// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/open_files.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <vector>

#include "gtest/gtest.h"

namespace sheaf {
namespace {

TEST(OpenFilesTest, RaisesTheSoftLimit) {
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  constexpr rlim_t kFew = 64;
  ASSERT_GE(before.rlim_max, 2 * kFew);
  const rlimit low{kFew, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &low), 0);
  EXPECT_EQ(RaiseOpenFileLimit(), before.rlim_max);
  std::vector<int> files;
  for (rlim_t i = 0; i < kFew; ++i) files.push_back(::open("/dev/null", O_RDONLY | O_CLOEXEC));
  for (const int file : files) {
    EXPECT_GE(file, 0);
    ::close(file);
  }
  EXPECT_EQ(::setrlimit(RLIMIT_NOFILE, &before), 0);
}

}  // namespace
}  // namespace sheaf
