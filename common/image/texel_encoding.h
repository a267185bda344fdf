// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TexelEncoding: how the numbers of a texture become linear values.
#pragma once

#include <cstddef>
#include <vector>

namespace sheaf {

// How stored integers become linear values. Float images are always taken unchanged.
struct TexelEncoding {
  enum class Kind {
    kSrgb,
    kLinear,
    kGamma,  // value^gamma.
  } kind = Kind::kSrgb;
  float gamma = 1;
  friend bool operator==(const TexelEncoding&, const TexelEncoding&) = default;
};

// The linear value of an integer that was divided by its largest value.
float DecodeTexel(float encoded, TexelEncoding encoding);
// The linear values of the integers from 0 to count - 1.
std::vector<float> TexelDecodeTable(TexelEncoding encoding, size_t count);

}  // namespace sheaf
