// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Stores many small blobs at once. They share the waits for the disk, which for one byte each are
// nearly all of the cost.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "common/content/blob_store.h"

namespace sheaf {

// Limits of one message of small blobs.
inline constexpr size_t kSmallBlobsMax = 10'000;
inline constexpr uint64_t kSmallBlobBytesMax = uint64_t{64} << 10;
inline constexpr uint64_t kSmallBlobsBytesMax = uint64_t{4} << 20;  // Together.

// Stores the blobs whose bytes follow each other in bytes, in the order of digests. All are durable
// once it returns OK; at an error some may be. Errors: kInvalidArgument: a blob is larger than
// kSmallBlobBytesMax, has other bytes than its digest, or bytes has another size than all of them;
// kResourceExhausted (disk full).
absl::Status PutSmallBlobs(const BlobStore& store, const std::vector<BlobDigest>& digests,
                           std::string_view bytes);

}  // namespace sheaf
