// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Fuzz target: feeds arbitrary bytes to the decoder of film parts. Build with
// -fsanitize=fuzzer,address,undefined and run with -rss_limit_mb=512: DecodePart uses no more
// memory than its limit allows.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "common/base/check.h"
#include "common/film/exr/exr_codec.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size_bytes) {
  constexpr int64_t kPartPixelsMax = 1 << 16;  // 82 channels of 4 bytes each: 21 MB.
  const absl::StatusOr<sheaf::DecodedPart> part = sheaf::DecodePart(
      std::string_view(reinterpret_cast<const char*>(bytes), size_bytes), kPartPixelsMax);
  if (!part.ok()) return 0;
  // Accepted bytes are a part: it can be encoded again, and decodes to an equal part.
  const absl::StatusOr<sheaf::DecodedPart> again =
      sheaf::DecodePart(sheaf::EncodePart(part->tile, part->header), kPartPixelsMax);
  SHEAF_CHECK(again.ok() && again->tile == part->tile);
  return 0;
}
