// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SetWireDigest: a digest as a message.
#pragma once

#include "common/content/blob_digest.h"
#include "sheaf/v1/content.pb.h"

namespace sheaf::cli {

inline void SetWireDigest(const BlobDigest& digest, v1::Digest* message) {
  message->set_sha256_hex(digest.sha256_hex);
  message->set_size_bytes(digest.size_bytes);
}

}  // namespace sheaf::cli
