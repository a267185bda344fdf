// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// BlobDigest: the name of a blob, its SHA-256 and size.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"

namespace sheaf {

struct BlobDigest {
  std::string sha256_hex;  // 64 lower-case hexadecimal digits.
  uint64_t size_bytes = 0;
  friend bool operator==(const BlobDigest&, const BlobDigest&) = default;
};

// Errors: kInvalidArgument if sha256_hex is not a SHA-256 in hexadecimal. Every function that takes
// an untrusted digest calls this first, so that a digest can safely become part of a path.
absl::Status CheckDigest(const BlobDigest& digest);

}  // namespace sheaf
