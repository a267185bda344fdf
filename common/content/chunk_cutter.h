// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Cuts bytes into chunks where their content says so: equal content gives equal chunks, also behind
// bytes that were inserted or removed. Two versions of a large file share nearly all chunks.
// Source: Xia et al. 2016, "FastCDC: a Fast and Efficient Content-Defined Chunking Approach for
// Data Deduplication" (gear hash, a hash of the last 64 bytes; normalized chunking).
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "common/content/chunk_list.h"

namespace sheaf {

// The length of the first chunk of bytes. bytes: all that follows in the file, or kChunkBytesMax of
// it or more. 0 for none.
size_t ChunkLength(std::string_view bytes);

// Cuts a file. Errors: those of opening and reading.
absl::StatusOr<ChunkList> CutFile(const std::string& path);

}  // namespace sheaf
