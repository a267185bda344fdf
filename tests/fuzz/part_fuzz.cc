// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the decoder of film parts, which keeps its memory within its limit.
#include "common/film/exr/exr_codec.h"
#include "tests/fuzz/fuzz_target.h"

namespace sheaf {

SHEAF_FUZZ_TARGET(part) {
  constexpr int64_t kPartPixelsMax = 1 << 16;  // 82 channels of 4 bytes each: 21 MB.
  const absl::StatusOr<DecodedPart> part = DecodePart(bytes, kPartPixelsMax);
  if (!part.ok()) return;
  // Accepted bytes are a part: it can be encoded again, and decodes to an equal part.
  const absl::StatusOr<DecodedPart> again =
      DecodePart(EncodePart(part->tile, part->header), kPartPixelsMax);
  SHEAF_CHECK(again.ok() && again->tile == part->tile);
}

}  // namespace sheaf
