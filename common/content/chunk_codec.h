// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Compresses chunks of bytes for the wire: one zstd frame each. The only file that uses zstd.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace sheaf {

// One zstd frame that includes its size and a checksum.
std::string CompressChunk(std::string_view bytes);

// The frame is untrusted: at most size_bytes_max bytes are allocated for its content.
// Errors: kInvalidArgument (not exactly one frame, or too large).
absl::StatusOr<std::string> DecompressChunk(std::string_view frame, uint64_t size_bytes_max);

}  // namespace sheaf
