// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/objects/s3_options.h"

#include <algorithm>
#include <cstdlib>
#include <map>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "common/base/file.h"
#include "common/objects/object_store.h"

namespace sheaf {
namespace {

constexpr uint64_t kConfigBytesMax = uint64_t{1} << 20;
constexpr size_t kBucketBytesMin = 3, kBucketBytesMax = 63;
constexpr char kDefaultRegion[] = "us-east-1";

using Section = std::map<std::string, std::string>;

// A section of a file "[NAME]", "key = value"; empty if there is none.
Section ReadSection(const std::string& path, const std::vector<std::string>& names) {
  Section section;
  const absl::StatusOr<std::string> text = ReadWholeFile(path, kConfigBytesMax);
  if (!text.ok()) return section;
  bool is_inside = false;
  for (absl::string_view line : absl::StrSplit(*text, '\n')) {
    // A setting of a nested section is indented, and none of these.
    const bool is_nested = !line.empty() && absl::ascii_isspace(line.front());
    line = absl::StripAsciiWhitespace(line);
    if (line.empty() || line.front() == '#' || line.front() == ';' || is_nested) continue;
    if (line.front() == '[' && line.back() == ']') {
      const std::string name(absl::StripAsciiWhitespace(line.substr(1, line.size() - 2)));
      is_inside = std::find(names.begin(), names.end(), name) != names.end();
      continue;
    }
    const size_t equals = line.find('=');
    if (!is_inside || equals == absl::string_view::npos) continue;
    section[std::string(absl::StripAsciiWhitespace(line.substr(0, equals)))] =
        std::string(absl::StripAsciiWhitespace(line.substr(equals + 1)));
  }
  return section;
}

// The variables, then the files.
class Settings {
 public:
  explicit Settings(const Environment& environment) : environment_(environment) {
    const std::string home = Variable({"HOME"});
    profile_ = Variable({"AWS_PROFILE", "AWS_DEFAULT_PROFILE"});
    if (profile_.empty()) profile_ = "default";
    credentials_path_ = Variable({"AWS_SHARED_CREDENTIALS_FILE"});
    if (credentials_path_.empty()) credentials_path_ = home + "/.aws/credentials";
    std::string config_path = Variable({"AWS_CONFIG_FILE"});
    if (config_path.empty()) config_path = home + "/.aws/config";
    credentials_ = ReadSection(credentials_path_, {profile_});
    config_ = ReadSection(config_path, {profile_, "profile " + profile_});
  }

  // The first variable of these that is set and not empty.
  std::string Variable(const std::vector<std::string>& names) const {
    for (const std::string& name : names) {
      const std::optional<std::string> value = environment_(name);
      if (value && !value->empty()) return *value;
    }
    return "";
  }
  std::string Config(const std::string& name) const {
    const auto found = config_.find(name);
    return found == config_.end() ? "" : found->second;
  }
  std::string Credential(const std::string& name) const {
    const auto found = credentials_.find(name);
    return found == credentials_.end() ? Config(name) : found->second;
  }
  const std::string& credentials_path() const { return credentials_path_; }
  const std::string& profile() const { return profile_; }

 private:
  const Environment& environment_;
  std::string profile_, credentials_path_;
  Section credentials_, config_;
};

bool IsBucketName(const std::string& name) {
  const auto is_allowed = [](char c) {
    return absl::ascii_islower(c) || absl::ascii_isdigit(c) || c == '.' || c == '-';
  };
  return name.size() >= kBucketBytesMin && name.size() <= kBucketBytesMax &&
         std::all_of(name.begin(), name.end(), is_allowed);
}

absl::Status SetPlace(const std::string& url, S3Options* options) {
  absl::string_view rest = url;
  const bool is_s3 = absl::ConsumePrefix(&rest, "s3://");
  const std::pair<std::string, std::string> parts = absl::StrSplit(rest, absl::MaxSplits('/', 1));
  options->bucket = parts.first;
  options->prefix = parts.second;
  while (absl::EndsWith(options->prefix, "/")) options->prefix.pop_back();
  const bool is_place = is_s3 && IsBucketName(options->bucket) &&
                        (options->prefix.empty() || CheckObjectKey(options->prefix).ok());
  if (is_place) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("\"", url,
                   "\" names no place of objects; write s3://BUCKET or s3://BUCKET/PREFIX, with a "
                   "bucket of 3 to 63 lower-case letters, digits, \".\" and \"-\""));
}

absl::Status SetServer(const Settings& settings, S3Options* options) {
  options->region = settings.Variable({"AWS_REGION", "AWS_DEFAULT_REGION"});
  if (options->region.empty()) options->region = settings.Config("region");
  if (options->region.empty()) options->region = kDefaultRegion;
  std::string endpoint = settings.Variable({"AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL"});
  if (endpoint.empty()) endpoint = settings.Config("endpoint_url");
  if (endpoint.empty()) endpoint = absl::StrCat("https://s3.", options->region, ".amazonaws.com");
  while (absl::EndsWith(endpoint, "/")) endpoint.pop_back();
  options->endpoint = endpoint;
  options->ca_file = settings.Variable({"AWS_CA_BUNDLE"});
  absl::string_view host = endpoint;
  const bool is_http =
      absl::ConsumePrefix(&host, "https://") || absl::ConsumePrefix(&host, "http://");
  if (is_http && !host.empty() && !absl::StrContains(host, "/") && !absl::StrContains(host, "@")) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat(
      "AWS_ENDPOINT_URL: \"", absl::StrContains(endpoint, "@") ? "..." : endpoint,
      "\" is no endpoint; write https://HOST or http://HOST:PORT, without a path or a password"));
}

}  // namespace

std::optional<std::string> ProcessEnvironment(const std::string& name) {
  const char* const value = std::getenv(name.c_str());
  return value == nullptr ? std::nullopt : std::optional<std::string>(value);
}

absl::StatusOr<S3Options> ReadS3Options(const std::string& url, const Environment& environment) {
  S3Options options;
  if (absl::Status status = SetPlace(url, &options); !status.ok()) return status;
  const Settings settings(environment);
  if (absl::Status status = SetServer(settings, &options); !status.ok()) return status;
  S3Credentials& key = options.credentials;
  key.access_key_id = settings.Variable({"AWS_ACCESS_KEY_ID"});
  key.secret_access_key = settings.Variable({"AWS_SECRET_ACCESS_KEY"});
  key.session_token = settings.Variable({"AWS_SESSION_TOKEN"});
  if (key.access_key_id.empty() && key.secret_access_key.empty()) {
    key = {settings.Credential("aws_access_key_id"), settings.Credential("aws_secret_access_key"),
           settings.Credential("aws_session_token")};
  }
  if (!key.access_key_id.empty() && !key.secret_access_key.empty()) return options;
  return absl::FailedPreconditionError(
      absl::StrCat(url,
                   ": no key to it: set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or write "
                   "aws_access_key_id and aws_secret_access_key into section [",
                   settings.profile(), "] of ", settings.credentials_path()));
}

}  // namespace sheaf
