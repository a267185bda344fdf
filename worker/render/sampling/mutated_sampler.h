// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MutatedSampler: the numbers of a sample, moved by a chain of mutations. A state of the chain is a
// point of the unit cube of all slots, and a pixel; a mutation moves each coordinate by a random
// distance, modulo 1, and the pixel by a random number of pixels. Distances have a symmetric
// distribution, so a mutation and its inverse have the same density.
//
// Movements are hashes of (key of the chain, slot, step), so a coordinate of a state is the sum of
// its movements at the accepted steps. It is computed when a path first asks for the slot: the
// slots that a path does not use move too. Sums are of integers, so their order does not matter.
//
// Source: Kelemen, Szirmay-Kalos, Antal and Csonka 2002, "A Simple and Robust Mutation Strategy for
// the Metropolis Light Transport Algorithm" (the space, and distances with density 1/x; here each
// octave is uniform, which needs no logarithm).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/base/check.h"
#include "common/math/mix_bits.h"
#include "common/math/vec.h"
#include "worker/render/sampling/sampler.h"

namespace sheaf::render {

// The most states of a chain, its seed included.
inline constexpr uint32_t kChainStatesMax = 64;

// Not thread-safe: const functions fill a cache.
class MutatedSampler {
 public:
  // Coordinates move by 2^-14 to 2^-6, pixels by 1/4 to 16, rounded. All octaves are as likely.
  static constexpr uint32_t kCoordinateOctaves = 8, kPixelOctaves = 6;
  static constexpr uint32_t kCoordinateBits = 24;
  static constexpr uint32_t kLeastCoordinateBits = 10;  // 2^10 of the 2^24 values.
  static constexpr uint32_t kPixelFractionBits = 4;     // Pixels are drawn in sixteenths.
  static constexpr uint32_t kLeastPixelBits = 2;

  // The numbers of `seed`, unmoved.
  explicit MutatedSampler(const Sampler& seed) : seed_(seed) {}

  // Begins a chain at the seed. key: unique to the chain within the image.
  void Begin(uint64_t key) {
    key_ = MixBits(key + kStride);
    step_ = accepted_count_ = 0;
    moves_ = false;
    state_x_ = state_y_ = 0;
    cached_.fill({});
  }
  // Mutates the state: all numbers, and x() and y(), are those of the proposal. Requires: Begin has
  // been called, and this less than kChainStatesMax - 1 times since.
  void Propose() {
    SHEAF_CHECK(++step_ < kChainStatesMax);
    moves_ = true;
    const uint64_t movement = Movement(kPixelSlot, step_);
    proposed_x_ = state_x_ + PixelsOf(static_cast<uint32_t>(movement));
    proposed_y_ = state_y_ + PixelsOf(static_cast<uint32_t>(movement >> 32));
  }
  // The proposal becomes the state. Requires: it has been proposed.
  void Accept() {
    accepted_[accepted_count_++] = step_;
    state_x_ = proposed_x_;
    state_y_ = proposed_y_;
    moves_ = false;
  }
  // How far the pixel is from the seed's.
  int32_t x() const { return moves_ ? proposed_x_ : state_x_; }
  int32_t y() const { return moves_ ? proposed_y_ : state_y_; }
  // A number of the current step that depends on no movement; in [0, 1).
  double ChoiceOfStep() const {
    return static_cast<double>(Movement(kChoiceSlot, step_) >> 11) * 0x1p-53;
  }

  // As those of Sampler.
  std::array<float, 4> Get4(uint32_t slot) const {
    if (IsSeed()) return seed_.Get4(slot);
    const Coordinates at = At(slot);
    return {Unit(at[0]), Unit(at[1]), Unit(at[2]), Unit(at[3])};
  }
  Vec2f Get2(uint32_t slot) const {
    if (IsSeed()) return seed_.Get2(slot);
    const Coordinates at = At(slot);
    return {Unit(at[0]), Unit(at[1])};
  }
  float Get1(uint32_t slot) const { return IsSeed() ? seed_.Get1(slot) : Unit(At(slot)[0]); }

 private:
  // In units of 2^-24, modulo 2^32: the upper bits carry no meaning.
  using Coordinates = std::array<uint32_t, 4>;
  // The coordinates of a slot after the first `accepted` accepted steps.
  struct Cached {
    uint32_t slot, accepted;
    bool is_used;
    Coordinates at;
  };

  static constexpr uint64_t kStride = 0x9e3779b97f4a7c15u;
  static constexpr uint64_t kUpperCoordinates = 0x243f6a8885a308d3u;
  // Beyond all slots of dimensions.h.
  static constexpr uint32_t kPixelSlot = ~uint32_t{0}, kChoiceSlot = ~uint32_t{1};
  static constexpr size_t kCachedSlots = 256;  // Further slots are summed anew: a power of two.
  static constexpr size_t kProbes = 4;

  bool IsSeed() const { return !moves_ && accepted_count_ == 0; }
  uint64_t Movement(uint32_t slot, uint32_t step) const {
    return MixBits(key_ ^ MixBits(((uint64_t{step} << 32) | slot) * kStride));
  }
  // A symmetric distance, in an octave from 2^least_bits on. The word's upper half chooses the
  // octave; of the lower half, one bit is the sign, and the others are the place in the octave.
  static constexpr int32_t Distance(uint32_t word, uint32_t least_bits, uint32_t octaves) {
    const uint32_t octave = ((word >> 16) * octaves) >> 16;
    const uint32_t least = uint32_t{1} << (least_bits + octave);
    const uint32_t place = ((word & 0x7fffu) * least) >> 15;
    const auto distance = static_cast<int32_t>(least + place);
    return (word & 0x8000u) != 0 ? -distance : distance;
  }
  static constexpr int32_t PixelsOf(uint32_t word) {
    // Rounds the size, so that both directions are alike.
    const int32_t distance = Distance(word, kLeastPixelBits, kPixelOctaves);
    const int32_t size = distance < 0 ? -distance : distance;
    const int32_t pixels = (size + (1 << (kPixelFractionBits - 1))) >> kPixelFractionBits;
    return distance < 0 ? -pixels : pixels;
  }
  static float Unit(uint32_t coordinate) {
    return static_cast<float>(static_cast<int32_t>(coordinate & ((1u << kCoordinateBits) - 1))) *
           0x1p-24f;
  }
  void Move(uint32_t slot, uint32_t step, Coordinates* at) const {
    const uint64_t lower = Movement(slot, step);
    const uint64_t upper = MixBits(lower + kUpperCoordinates);
    const std::array<uint32_t, 4> words = {
        static_cast<uint32_t>(lower), static_cast<uint32_t>(lower >> 32),
        static_cast<uint32_t>(upper), static_cast<uint32_t>(upper >> 32)};
    for (size_t i = 0; i < words.size(); ++i) {
      (*at)[i] +=
          static_cast<uint32_t>(Distance(words[i], kLeastCoordinateBits, kCoordinateOctaves));
    }
  }
  Cached AtSeed(uint32_t slot) const {
    const std::array<float, 4> u = seed_.Get4(slot);
    Cached at{slot, 0, true, {}};
    for (size_t i = 0; i < u.size(); ++i) at.at[i] = static_cast<uint32_t>(u[i] * 0x1p24f);
    return at;
  }
  Coordinates At(uint32_t slot) const {
    Cached uncached;
    Cached* found = Find(slot);
    if (found == nullptr) {
      uncached = AtSeed(slot);
      found = &uncached;
    }
    while (found->accepted < accepted_count_) Move(slot, accepted_[found->accepted++], &found->at);
    Coordinates at = found->at;
    if (moves_) Move(slot, step_, &at);
    return at;
  }
  // The place of the slot; null where the cache has none left for it.
  Cached* Find(uint32_t slot) const {
    const size_t first = MixBits(slot);
    for (size_t i = 0; i < kProbes; ++i) {
      Cached& place = cached_[(first + i) % kCachedSlots];
      if (!place.is_used) place = AtSeed(slot);
      if (place.slot == slot) return &place;
    }
    return nullptr;
  }

  const Sampler& seed_;
  uint64_t key_ = 0;
  uint32_t step_ = 0, accepted_count_ = 0;
  bool moves_ = false;  // The numbers are those of the proposal, not of the state.
  int32_t state_x_ = 0, state_y_ = 0, proposed_x_ = 0, proposed_y_ = 0;
  // Unset until a chain begins.
  std::array<uint32_t, kChainStatesMax> accepted_;
  mutable std::array<Cached, kCachedSlots> cached_;
};

}  // namespace sheaf::render
