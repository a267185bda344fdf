// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// OwnerBytes: what a user keeps on the coordinator's disk, and the limit of it
// (`--user-bytes-max`), so that no user fills the disk for the others.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"

namespace sheaf::coordinator {

struct OwnerBytes {
  uint64_t content_bytes = 0;  // Uploaded files that only this user's jobs need, or nobody's yet.
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

// Whether a user that keeps `kept` may add more bytes; 0: whether the user may begin anything that
// adds some. Errors: kResourceExhausted, saying what takes how much and what to do.
absl::Status CheckOwnerBytes(const std::string& owner, const OwnerBytes& kept, uint64_t more,
                             uint64_t bytes_max);

}  // namespace sheaf::coordinator
