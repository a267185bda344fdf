// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the readers of lists of chunks: as text from a disk, and as a message of
// a client. A list that is accepted keeps all limits and says the same when it is written again.
#include "common/content/chunk_list.h"

#include <string>

#include "common/rpc/chunk_list_codec.h"
#include "tests/fuzz/fuzz_target.h"

namespace sheaf {

SHEAF_FUZZ_TARGET(chunk_list) {
  const absl::StatusOr<ChunkList> list = DecodeChunkList(bytes);
  if (list.ok()) {
    SHEAF_CHECK(CheckChunkList(*list).ok());
    const absl::StatusOr<ChunkList> again = DecodeChunkList(EncodeChunkList(*list));
    SHEAF_CHECK(again.ok() && *again == *list);
  }
  v1::PlanWriteRequest request;
  if (!request.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return;
  const absl::StatusOr<ChunkList> wire = ChunkListFromWire(request.digest(), request.chunks());
  if (!wire.ok()) return;
  SHEAF_CHECK(CheckChunkList(*wire).ok());
  v1::PlanWriteRequest written;
  ChunksToWire(*wire, written.mutable_chunks());
  const absl::StatusOr<ChunkList> back = ChunkListFromWire(request.digest(), written.chunks());
  SHEAF_CHECK(back.ok() && *back == *wire);
}

}  // namespace sheaf
