// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/access/audit_log.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/base/file.h"

namespace sheaf::coordinator {
namespace {

const absl::Time kAuditTime = absl::FromUnixSeconds(1'800'000'000);

class AuditLogTest : public ::testing::Test {
 protected:
  AuditLogTest()
      : directory_(::testing::TempDir() + "sheaf-audit-" +
                   ::testing::UnitTest::GetInstance()->current_test_info()->name()),
        path_(directory_ + "/audit.log") {
    std::filesystem::remove_all(directory_);
    std::filesystem::create_directories(directory_);
  }
  ~AuditLogTest() override { std::filesystem::remove_all(directory_); }

  std::vector<nlohmann::json> Lines() const {
    std::vector<nlohmann::json> lines;
    const std::string text = *ReadWholeFile(path_);
    for (const absl::string_view line : absl::StrSplit(text, '\n', absl::SkipEmpty())) {
      lines.push_back(nlohmann::json::parse(line));
    }
    return lines;
  }

  const std::string directory_, path_;
};

TEST_F(AuditLogTest, ALineSaysWhoDidWhatToWhatAndHowItEnded) {
  AuditLog log(path_);
  log.Note("user:anna", "CancelJob", "jobs/7", absl::OkStatus());
  log.Note("user:ben\n\xff", "CancelJob", "jobs/8", absl::NotFoundError("no such job"));
  const std::vector<nlohmann::json> lines = Lines();
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0]["who"], "user:anna");
  EXPECT_EQ(lines[0]["what"], "CancelJob");
  EXPECT_EQ(lines[0]["target"], "jobs/7");
  EXPECT_EQ(lines[0]["outcome"], "ok");
  EXPECT_EQ(lines[1]["outcome"], "NOT_FOUND: no such job");
  struct stat info {};
  ASSERT_EQ(::stat(path_.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0600u);
}

TEST_F(AuditLogTest, AFloodOfRefusalsIsCounted) {
  AuditLog log(path_);
  const absl::Status refused = absl::UnauthenticatedError("no certificate");
  for (int i = 0; i < kAuditRefusalsPerMinuteMax + 5; ++i) {
    log.NoteRefused("192.0.2.7", "GetJob", refused, kAuditTime);
  }
  EXPECT_EQ(Lines().size(), static_cast<size_t>(kAuditRefusalsPerMinuteMax));
  log.NoteRefused("192.0.2.7", "GetJob", refused, kAuditTime + absl::Minutes(1));
  const std::vector<nlohmann::json> lines = Lines();
  ASSERT_EQ(lines.size(), static_cast<size_t>(kAuditRefusalsPerMinuteMax) + 2);
  EXPECT_EQ(lines[lines.size() - 2]["outcome"], "5 more calls were refused and are not listed");
}

TEST_F(AuditLogTest, FilesAreLimitedInSizeAndNumber) {
  ASSERT_TRUE(WriteFileOnce(path_, std::string(kAuditFileBytesMax, '\n')).ok());
  for (int i = 1; i <= kAuditFilesKept; ++i) {
    ASSERT_TRUE(WriteFileOnce(absl::StrCat(path_, ".", i), absl::StrCat("old ", i)).ok());
  }
  AuditLog log(path_);
  log.Note("user:anna", "CancelJob", "jobs/7", absl::OkStatus());
  log.Note("user:anna", "CancelJob", "jobs/8", absl::OkStatus());
  ASSERT_EQ(Lines().size(), 1u);
  EXPECT_EQ(Lines()[0]["target"], "jobs/8");
  EXPECT_GT(std::filesystem::file_size(path_ + ".1"), kAuditFileBytesMax);
  EXPECT_EQ(*ReadWholeFile(absl::StrCat(path_, ".", kAuditFilesKept)),
            absl::StrCat("old ", kAuditFilesKept - 1));
  EXPECT_FALSE(std::filesystem::exists(absl::StrCat(path_, ".", kAuditFilesKept + 1)));
}

}  // namespace
}  // namespace sheaf::coordinator
