// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/sampler.h"

#include "common/film/film_tile.h"

namespace sheaf::render {
namespace {

constexpr uint64_t ReverseBits64(uint64_t v) {
  return (uint64_t{sobol::ReverseBits(static_cast<uint32_t>(v))} << 32) |
         sobol::ReverseBits(static_cast<uint32_t>(v >> 32));
}

}  // namespace

Sampler::Sampler(uint64_t seed, int32_t pixel_x, int32_t pixel_y, uint64_t sample_index)
    : index_reversed_(ReverseBits64(IndexInReplicate(sample_index))) {
  const uint64_t pixel =
      (uint64_t{static_cast<uint32_t>(pixel_y)} << 32) | static_cast<uint32_t>(pixel_x);
  // One full mix an input: sums of raw inputs would let seeds and pixels cancel each other.
  key_ = MixBits(seed + 1);
  key_ = MixBits(key_ ^ pixel);
  key_ = MixBits(key_ + ReplicateOf(sample_index) + 1);
}

}  // namespace sheaf::render
