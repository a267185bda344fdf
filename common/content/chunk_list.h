// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ChunkList: the chunks into which a blob is cut (chunk_cutter.h), each named as a blob is.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/content/blob_digest.h"

namespace sheaf {

// Limits of a chunk's length; the last one of a blob may be shorter.
inline constexpr uint32_t kChunkBytesMin = uint32_t{256} << 10;
inline constexpr uint32_t kChunkBytesAverage = uint32_t{1} << 20;
inline constexpr uint32_t kChunkBytesMax = uint32_t{4} << 20;
// Larger blobs are transferred by chunks.
inline constexpr uint64_t kUnchunkedBytesMax = kChunkBytesMax;
// Chunks of one blob, which its list in one message allows; larger blobs are transferred whole.
inline constexpr size_t kChunksPerBlobMax = 400'000;

struct ChunkList {
  BlobDigest blob;
  std::vector<BlobDigest> chunks;  // In order, without gaps.
  friend bool operator==(const ChunkList&, const ChunkList&) = default;
};

// Whether it can be the list of its blob. Errors: kInvalidArgument: a malformed digest, a length
// beyond the limits above, or lengths whose sum is not the blob's.
absl::Status CheckChunkList(const ChunkList& list);

// A line "DIGEST SIZE" for the blob and each chunk, and back. The text is untrusted. Errors:
// kInvalidArgument, also those of CheckChunkList.
std::string EncodeChunkList(const ChunkList& list);
absl::StatusOr<ChunkList> DecodeChunkList(std::string_view text);

}  // namespace sheaf
