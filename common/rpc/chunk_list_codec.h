// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Converts lists of chunks to and from messages, for client, coordinator and worker.
#pragma once

#include <google/protobuf/repeated_ptr_field.h>

#include "absl/status/statusor.h"
#include "common/content/chunk_list.h"
#include "sheaf/v1/transfer.pb.h"

namespace sheaf {

// Appends the chunks. Requires: CheckChunkList is OK.
void ChunksToWire(const ChunkList& list, google::protobuf::RepeatedPtrField<v1::Chunk>* chunks);

// The messages are untrusted. Errors: kInvalidArgument, also those of CheckChunkList.
absl::StatusOr<ChunkList> ChunkListFromWire(
    const v1::Digest& blob, const google::protobuf::RepeatedPtrField<v1::Chunk>& chunks);

}  // namespace sheaf
