// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A bijective hash of 64 bits to 64 in which each output bit depends on all input bits.
#pragma once

#include <cstdint>

namespace sheaf {

// Source: Steele, Lea and Flood 2014, "Fast Splittable Pseudorandom Number Generators": the mixer
// of SplitMix64, which is variant 13 of Stafford 2011, "Better Bit Mixing".
constexpr uint64_t MixBits(uint64_t v) {
  v = (v ^ (v >> 30)) * 0xbf58476d1ce4e5b9u;
  v = (v ^ (v >> 27)) * 0x94d049bb133111ebu;
  return v ^ (v >> 31);
}

}  // namespace sheaf
