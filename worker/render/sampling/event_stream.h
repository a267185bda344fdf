// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EventStream: random numbers for walks of unknown length, such as tentative collisions along a
// ray. A function of its key alone: draw n of a key is the same whoever draws it. Sample points
// (sampler.h) are for what a path has a fixed number of.
#pragma once

#include <array>
#include <cstdint>

#include "common/math/elementary.h"
#include "common/math/mix_bits.h"

namespace sheaf::render {

class EventStream {
 public:
  // The key: numbers that no other walk of the picture has together.
  explicit EventStream(const std::array<uint32_t, 4>& key)
      : state_(MixBits(MixBits(Join(key[0], key[1]) + kStep) ^ Join(key[2], key[3]))) {}

  // In [0, 1), with 53 bits: thin media need the small ones.
  double Uniform() {
    state_ += kStep;
    return static_cast<double>(MixBits(state_) >> 11) * 0x1p-53;
  }
  // An exponential of mean 1, to 2^-39 of itself: an optical depth.
  double Exponential() { return -elementary::LogForFloat(1 - Uniform()); }

 private:
  static constexpr uint64_t kStep = 0x9e3779b97f4a7c15u;
  static constexpr uint64_t Join(uint32_t high, uint32_t low) {
    return (uint64_t{high} << 32) | low;
  }

  uint64_t state_;
};

}  // namespace sheaf::render
