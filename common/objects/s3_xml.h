// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The XML that S3 answers with. The door to TinyXML-2.
// Source: Amazon S3 API Reference.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/objects/object_store.h"

namespace sheaf {

struct S3Error {
  std::string code;     // "NoSuchBucket"; empty if the text is not an error of S3.
  std::string message;  // In the server's words.
};

S3Error ParseS3Error(const std::string& xml);

// One page of ListObjectsV2.
struct S3Page {
  std::vector<StoredObject> objects;  // With whole keys.
  std::vector<std::string> prefixes;  // Common ones, each with its "/".
  std::string next_token;             // Empty: the last page.
};

// Errors of all three: kUnavailable, because a proxy or a broken server wrote it.
absl::StatusOr<S3Page> ParseS3Page(const std::string& xml);
absl::StatusOr<std::string> ParseUploadId(const std::string& xml);
// The keys that DeleteObjects could not remove, with why.
absl::StatusOr<std::vector<std::string>> ParseFailedRemovals(const std::string& xml);

// The bodies of CompleteMultipartUpload and DeleteObjects.
std::string FormatCompletedUpload(const std::vector<std::string>& etags);
std::string FormatRemovals(const std::vector<std::string>& keys);

}  // namespace sheaf
