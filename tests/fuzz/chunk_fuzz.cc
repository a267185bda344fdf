// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the decoder of compressed chunks, which may not allocate more than the
// limit that its caller states.
#include "common/content/chunk_codec.h"

#include <string>

#include "tests/fuzz/fuzz_target.h"

namespace sheaf {

SHEAF_FUZZ_TARGET(chunk) {
  constexpr uint64_t kBytesMax = 1 << 16;
  const absl::StatusOr<std::string> content = DecompressChunk(bytes, kBytesMax);
  if (content.ok()) SHEAF_CHECK(content->size() <= kBytesMax);
  if (bytes.size() > kBytesMax) return;
  const absl::StatusOr<std::string> again = DecompressChunk(CompressChunk(bytes), kBytesMax);
  SHEAF_CHECK(again.ok() && *again == bytes);
}

}  // namespace sheaf
