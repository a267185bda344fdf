// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// OwnerBytes: a user's bytes on the coordinator's disk, and their limit (`--user-bytes-max`), so
// that no user fills the disk.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"

namespace sheaf::coordinator {

struct OwnerBytes {
  uint64_t content_bytes = 0;  // Uploads needed only by this user's jobs, or by none.
  uint64_t part_bytes = 0;
  uint64_t image_bytes = 0;
  uint64_t preview_bytes = 0;  // Small images of the ends of rounds.

  uint64_t Total() const { return content_bytes + part_bytes + image_bytes + preview_bytes; }
  friend bool operator==(const OwnerBytes&, const OwnerBytes&) = default;
};

// "1.5 GiB".
std::string FormatBytes(uint64_t bytes);
// "3.0 GiB of parts, 1.0 GiB of images, ...".
std::string DescribeBytes(const OwnerBytes& bytes);

// Checks that a user with `kept` may store `more` bytes; with 0, that the user may begin work that
// stores some. Errors: kResourceExhausted, with the bytes of each kind and what to do.
absl::Status CheckOwnerBytes(const std::string& owner, const OwnerBytes& kept, uint64_t more,
                             uint64_t bytes_max);

}  // namespace sheaf::coordinator
