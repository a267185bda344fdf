// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// S3Options: a bucket, its server and the key to it. The key comes from where the tools of S3 look
// for it, never from a command line:
//
//     AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY, AWS_SESSION_TOKEN
//     otherwise the section AWS_PROFILE ("default") of the file AWS_SHARED_CREDENTIALS_FILE
//     (~/.aws/credentials)
//     AWS_ENDPOINT_URL_S3, AWS_ENDPOINT_URL, AWS_REGION, AWS_DEFAULT_REGION
//     otherwise the same section of the file AWS_CONFIG_FILE (~/.aws/config)
//     AWS_CA_BUNDLE: certificates to trust instead of the system's
//
// Source: "Environment variables to configure the AWS CLI" and "Configuration and credential file
// settings", AWS CLI User Guide.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "common/objects/sigv4.h"

namespace sheaf {

struct S3Options {
  std::string endpoint;  // "https://HOST:PORT", without a "/" at the end.
  std::string region;
  std::string bucket;
  std::string prefix;  // Without "/" at both ends; may be empty.
  std::string ca_file;
  S3Credentials credentials;
};

using Environment = std::function<std::optional<std::string>(const std::string& name)>;
std::optional<std::string> ProcessEnvironment(const std::string& name);

// url: "s3://BUCKET" or "s3://BUCKET/PREFIX". Errors: kInvalidArgument (the URL or an endpoint is
// malformed); kFailedPrecondition (no key is found), with where it was looked for.
absl::StatusOr<S3Options> ReadS3Options(const std::string& url, const Environment& environment);

}  // namespace sheaf
