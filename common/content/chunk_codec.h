// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Runs of bytes as they travel: one zstd frame each. The only door to zstd.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace sheaf {

// One zstd frame that holds its size and a checksum.
std::string CompressChunk(std::string_view bytes);

// The frame is untrusted: no more than size_bytes_max bytes are ever taken for its content.
// Errors: kInvalidArgument (not one whole frame, or larger than size_bytes_max).
absl::StatusOr<std::string> DecompressChunk(std::string_view frame, uint64_t size_bytes_max);

}  // namespace sheaf
