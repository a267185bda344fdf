// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Names of jobs and frames, and digests, on the wire.
#include <string>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "coordinator/service/grpc/wire.h"

namespace sheaf::coordinator {
namespace {

absl::Status NameError(const std::string& name, const char* form) {
  return absl::InvalidArgumentError(absl::StrCat("name: \"", name, "\" is not of the form ", form));
}

}  // namespace

absl::StatusOr<std::string> ParseJobName(const std::string& name) {
  const std::vector<std::string> words = absl::StrSplit(name, '/');
  if (words.size() != 2 || words[0] != "jobs" || words[1].empty()) {
    return NameError(name, "jobs/ID");
  }
  return words[1];
}

absl::StatusOr<FrameId> ParseFrameName(const std::string& name) {
  const std::vector<std::string> words = absl::StrSplit(name, '/');
  FrameId id;
  if (words.size() != 4 || words[0] != "jobs" || words[2] != "frames" ||
      !absl::SimpleAtoi(words[1], &id.job_id) || !absl::SimpleAtoi(words[3], &id.frame_number)) {
    return NameError(name, "jobs/ID/frames/NUMBER");
  }
  return id;
}

std::string FrameName(const FrameId& id) {
  return absl::StrCat("jobs/", id.job_id, "/frames/", id.frame_number);
}

absl::StatusOr<BlobDigest> FromWire(const v1::Digest& wire) {
  BlobDigest digest{wire.sha256_hex(), wire.size_bytes()};
  if (absl::Status status = CheckDigest(digest); !status.ok()) return status;
  return digest;
}

v1::Digest ToWire(const BlobDigest& digest) {
  v1::Digest wire;
  wire.set_sha256_hex(digest.sha256_hex);
  wire.set_size_bytes(digest.size_bytes);
  return wire;
}

}  // namespace sheaf::coordinator
