// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/texel_encoding.h"

#include "common/image/image_io.h"
#include "common/math/elementary.h"

namespace sheaf {

float DecodeTexel(float encoded, TexelEncoding encoding) {
  switch (encoding.kind) {
    case TexelEncoding::Kind::kSrgb:
      return DecodeSrgb(encoded);
    case TexelEncoding::Kind::kGamma:
      return Pow(encoded, encoding.gamma);
    case TexelEncoding::Kind::kLinear:
      break;
  }
  return encoded;
}

std::vector<float> TexelDecodeTable(TexelEncoding encoding, size_t count) {
  std::vector<float> table(count);
  for (size_t i = 0; i < count; ++i) {
    table[i] = DecodeTexel(static_cast<float>(i) / static_cast<float>(count - 1), encoding);
  }
  return table;
}

}  // namespace sheaf
