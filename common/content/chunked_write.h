// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ChunkedWrite: writes a blob of which some chunks are sent, and the others are in blobs that are
// stored. An interrupted one is resumed at the beginning of a chunk.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/content/blob_store.h"
#include "common/content/chunk_index.h"
#include "common/content/chunk_list.h"

namespace sheaf {

// The chunks of a blob to send.
struct ChunkPlan {
  bool complete = false;        // The blob is there; nothing is to be sent.
  uint64_t offset_bytes = 0;    // An earlier write has brought the chunks before.
  std::vector<size_t> missing;  // Indices of the chunks to send, ascending.
};

// Errors: those of CheckChunkList.
absl::StatusOr<ChunkPlan> PlanChunks(const BlobStore& store, ChunkIndex* index,
                                     const ChunkList& list);

// Thread safety: one thread at a time.
class ChunkedWrite {
 public:
  // Starts or resumes at the plan's offset. index must outlive the result. Errors: those of
  // CheckChunkList and BlobStore::BeginWrite; kOutOfRange: not the beginning of a chunk, or beyond
  // the end of the partial file.
  static absl::StatusOr<ChunkedWrite> Begin(const BlobStore& store, ChunkIndex* index,
                                            const ChunkList& list, uint64_t offset_bytes);

  // Adds the chunk with this index, and before it those that were left out. Errors:
  // kInvalidArgument (an index out of order, or other bytes than the chunk's);
  // kFailedPrecondition: no blob has a chunk that was left out; those of BlobWriter::Append.
  absl::Status Append(size_t index, std::string_view bytes);
  // Adds the rest, verifies the blob and makes it durable, with its list. Errors: also those of
  // BlobWriter::Commit.
  absl::Status Finish();
  // Makes the chunks so far durable. For interrupted writes.
  absl::Status Flush() { return writer_.Flush(); }
  // Removes the partial file. No other call may follow.
  void Discard() { writer_.Discard(); }

  // Number of bytes in the partial file.
  uint64_t committed_bytes() const { return writer_.committed_bytes(); }

  uint64_t reused_bytes() const { return reused_bytes_; }

 private:
  ChunkedWrite(ChunkIndex* index, ChunkList list, BlobWriter writer, size_t next)
      : index_(index),
        list_(std::move(list)),
        writer_(std::move(writer)),
        first_(next),
        next_(next) {}
  // Adds stored chunks up to this index.
  absl::Status FillTo(size_t index);

  ChunkIndex* index_;
  ChunkList list_;
  BlobWriter writer_;
  size_t first_;  // Chunks before this one came in earlier attempts.
  size_t next_;   // The chunk to be written next.
  uint64_t reused_bytes_ = 0;
};

}  // namespace sheaf
