// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/chunk_list_codec.h"

#include "absl/strings/escaping.h"
#include "common/base/digest.h"

namespace sheaf {

void ChunksToWire(const ChunkList& list, google::protobuf::RepeatedPtrField<v1::Chunk>* chunks) {
  for (const BlobDigest& chunk : list.chunks) {
    v1::Chunk* wire = chunks->Add();
    wire->set_sha256(BytesOfHex(chunk.sha256_hex));
    wire->set_size_bytes(static_cast<uint32_t>(chunk.size_bytes));
  }
}

absl::StatusOr<ChunkList> ChunkListFromWire(
    const v1::Digest& blob, const google::protobuf::RepeatedPtrField<v1::Chunk>& chunks) {
  ChunkList list{{blob.sha256_hex(), blob.size_bytes()}, {}};
  for (const v1::Chunk& chunk : chunks) {
    list.chunks.push_back({absl::BytesToHexString(chunk.sha256()), chunk.size_bytes()});
  }
  if (absl::Status status = CheckChunkList(list); !status.ok()) return status;
  return list;
}

}  // namespace sheaf
