// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/farm_secret.h"

#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

class FarmSecretTest : public ::testing::Test {
 protected:
  FarmSecretTest() {
    directory_ = ::testing::TempDir() + "sheaf-secret-" +
                 ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(directory_);
    std::filesystem::create_directories(directory_);
  }
  ~FarmSecretTest() override { std::filesystem::remove_all(directory_); }
  std::string Path() const { return directory_ + "/lease.key"; }

  std::string directory_;
};

TEST_F(FarmSecretTest, SecretsStayAndAreTheOwnersAlone) {
  const absl::StatusOr<std::string> first = LoadOrMakeSecret(directory_);
  ASSERT_TRUE(first.ok()) << first.status();
  EXPECT_EQ(first->size(), 32u);
  EXPECT_EQ(*LoadOrMakeSecret(directory_), *first);
  struct stat properties {};
  ASSERT_EQ(::stat(Path().c_str(), &properties), 0);
  EXPECT_EQ(properties.st_mode & 0777, 0600u);
  std::filesystem::remove(Path());
  EXPECT_NE(*LoadOrMakeSecret(directory_), *first);
}

TEST_F(FarmSecretTest, SecretsThatOthersMayReadAreRefused) {
  ASSERT_TRUE(LoadOrMakeSecret(directory_).ok());
  ::chmod(Path().c_str(), 0644);
  EXPECT_THAT(std::string(LoadOrMakeSecret(directory_).status().message()), HasSubstr("chmod 600"));
}

TEST_F(FarmSecretTest, OtherFilesAreRefused) {
  for (const size_t size : {0, 31, 33, 1000}) {
    std::ofstream(Path()) << std::string(size, 'x');
    ::chmod(Path().c_str(), 0600);
    EXPECT_EQ(LoadOrMakeSecret(directory_).status().code(), absl::StatusCode::kFailedPrecondition)
        << size;
  }
}

}  // namespace
}  // namespace sheaf::coordinator
