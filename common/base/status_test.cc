// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/status.h"

#include <gtest/gtest.h>

#include <cerrno>

#include "common/base/check.h"
#include "common/base/log.h"

namespace sheaf {
namespace {

TEST(StatusTest, AnnotateKeepsTheCodeAndPrependsContext) {
  const absl::Status status = Annotate(absl::NotFoundError("no such mesh"), "scene.pbrt:3:7");
  EXPECT_EQ(status, absl::NotFoundError("scene.pbrt:3:7: no such mesh"));
  EXPECT_EQ(Annotate(status, "job 5"), absl::NotFoundError("job 5: scene.pbrt:3:7: no such mesh"));
  EXPECT_TRUE(Annotate(absl::OkStatus(), "nothing").ok());
}

TEST(StatusTest, ErrnoMapsToCodeAndMessage) {
  EXPECT_EQ(StatusFromErrno(ENOSPC, "writing x"),
            absl::ResourceExhaustedError("writing x: No space left on device"));
  EXPECT_TRUE(absl::IsResourceExhausted(StatusFromErrno(EDQUOT, "x")));
  EXPECT_TRUE(absl::IsResourceExhausted(StatusFromErrno(EFBIG, "x")));
  EXPECT_TRUE(absl::IsNotFound(StatusFromErrno(ENOENT, "x")));
  EXPECT_TRUE(absl::IsPermissionDenied(StatusFromErrno(EACCES, "x")));
  EXPECT_TRUE(absl::IsUnavailable(StatusFromErrno(EIO, "x")));
}

TEST(CheckDeathTest, ReportsLocationAndCondition) {
  SHEAF_CHECK(1 + 1 == 2);
  EXPECT_DEATH(SHEAF_CHECK(1 + 1 == 3), "status_test.cc:[0-9]+: check failed: 1 \\+ 1 == 3");
}

TEST(LogTest, LevelsHaveNames) {
  LogLevel level = LogLevel::kInfo;
  EXPECT_TRUE(LogLevelFromName("warning", &level));
  EXPECT_EQ(level, LogLevel::kWarning);
  EXPECT_FALSE(LogLevelFromName("loud", &level));
  EXPECT_EQ(level, LogLevel::kWarning);
}

}  // namespace
}  // namespace sheaf
