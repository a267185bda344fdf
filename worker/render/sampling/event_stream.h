// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EventStream: random numbers for walks of unknown length, such as tentative collisions along a
// ray. A pure function of the key: the n-th draw of a key is always the same. Sample points
// (sampler.h) serve the decisions of which a path has a fixed number.
#pragma once

#include <array>
#include <cstdint>

#include "common/math/elementary.h"
#include "common/math/mix_bits.h"

namespace sheaf::render {

class EventStream {
 public:
  // key: a combination that is unique to this walk within the image.
  explicit EventStream(const std::array<uint32_t, 4>& key)
      : state_(MixBits(MixBits(Join(key[0], key[1]) + kStep) ^ Join(key[2], key[3]))) {}

  // In [0, 1), with 53 bits: thin media need small values.
  double Uniform() {
    state_ += kStep;
    return static_cast<double>(MixBits(state_) >> 11) * 0x1p-53;
  }
  // Exponentially distributed with mean 1, to relative 2^-39: an optical depth.
  double Exponential() { return -elementary::LogForFloat(1 - Uniform()); }

 private:
  static constexpr uint64_t kStep = 0x9e3779b97f4a7c15u;
  static constexpr uint64_t Join(uint32_t high, uint32_t low) {
    return (uint64_t{high} << 32) | low;
  }

  uint64_t state_;
};

}  // namespace sheaf::render
