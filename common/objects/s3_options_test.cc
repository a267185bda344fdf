// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/objects/s3_options.h"

#include <map>

#include "absl/strings/match.h"
#include "common/base/file.h"
#include "gtest/gtest.h"

namespace sheaf {
namespace {

absl::StatusOr<S3Options> Read(const std::string& url,
                               const std::map<std::string, std::string>& variables) {
  return ReadS3Options(url, [&](const std::string& name) -> std::optional<std::string> {
    const auto found = variables.find(name);
    if (found == variables.end()) return std::nullopt;
    return found->second;
  });
}

TEST(S3OptionsTest, VariablesGiveKeyServerAndRegion) {
  const auto options = Read("s3://farm/a/b/", {{"AWS_ACCESS_KEY_ID", "KEY"},
                                               {"AWS_SECRET_ACCESS_KEY", "SECRET"},
                                               {"AWS_SESSION_TOKEN", "TOKEN"},
                                               {"AWS_REGION", "eu-west-3"},
                                               {"AWS_ENDPOINT_URL", "http://127.0.0.1:9000/"},
                                               {"AWS_CA_BUNDLE", "/ca.pem"}});
  ASSERT_TRUE(options.ok()) << options.status();
  EXPECT_EQ(options->bucket, "farm");
  EXPECT_EQ(options->prefix, "a/b");
  EXPECT_EQ(options->endpoint, "http://127.0.0.1:9000");
  EXPECT_EQ(options->region, "eu-west-3");
  EXPECT_EQ(options->ca_file, "/ca.pem");
  EXPECT_EQ(options->credentials.access_key_id, "KEY");
  EXPECT_EQ(options->credentials.secret_access_key, "SECRET");
  EXPECT_EQ(options->credentials.session_token, "TOKEN");
}

TEST(S3OptionsTest, FilesGiveWhatVariablesDoNot) {
  const std::string folder = ::testing::TempDir() + "/s3_options/.aws";
  ASSERT_TRUE(MakeDirectories(folder).ok());
  ASSERT_TRUE(
      WriteFileOnce(folder + "/credentials",
                    "[default]\naws_access_key_id = D\naws_secret_access_key=DS\n"
                    "# a remark\n[farm]\naws_access_key_id=F\naws_secret_access_key = F=S\n")
          .ok());
  ASSERT_TRUE(WriteFileOnce(folder + "/config",
                            "[default]\nregion = us-west-2\n[profile farm]\nregion=eu-north-1\n"
                            "s3 =\n  endpoint_url = http://nested\nendpoint_url = "
                            "https://objects.example.org\n")
                  .ok());
  const std::string home = ::testing::TempDir() + "/s3_options";
  const auto of_default = Read("s3://farm", {{"HOME", home}});
  ASSERT_TRUE(of_default.ok()) << of_default.status();
  EXPECT_EQ(of_default->credentials.access_key_id, "D");
  EXPECT_EQ(of_default->endpoint, "https://s3.us-west-2.amazonaws.com");
  const auto of_farm = Read("s3://farm", {{"HOME", home}, {"AWS_PROFILE", "farm"}});
  ASSERT_TRUE(of_farm.ok()) << of_farm.status();
  EXPECT_EQ(of_farm->credentials.secret_access_key, "F=S");
  EXPECT_EQ(of_farm->region, "eu-north-1");
  EXPECT_EQ(of_farm->endpoint, "https://objects.example.org");
}

TEST(S3OptionsTest, SaysWhatIsWrong) {
  const std::map<std::string, std::string> key = {
      {"AWS_ACCESS_KEY_ID", "KEY"}, {"AWS_SECRET_ACCESS_KEY", "SECRET"}, {"HOME", "/nonexistent"}};
  for (const char* url : {"http://farm", "s3://", "s3://ab", "s3://UPPER", "s3://farm/../x"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(Read(url, key).status())) << url;
  }
  std::map<std::string, std::string> with_password = key;
  with_password["AWS_ENDPOINT_URL"] = "http://me:hidden@host";
  const absl::Status refused = Read("s3://farm", with_password).status();
  EXPECT_TRUE(absl::IsInvalidArgument(refused));
  EXPECT_FALSE(absl::StrContains(refused.message(), "hidden")) << refused;
  const absl::Status none = Read("s3://farm", {{"HOME", "/nonexistent"}}).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(none));
  EXPECT_TRUE(absl::StrContains(none.message(), "/nonexistent/.aws/credentials")) << none;
}

}  // namespace
}  // namespace sheaf
