// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Sampler: (seed, pixel, sample index, slot) -> point of [0, 1)^4. Stateless and independent of
// call order: any machine can compute any sample. Each of the kReplicateCount replicates
// (common/film/film_tile.h) has its own Owen scramble; within one, points follow Sobol's sequence
// from its first point on.
//
// A slot (dimensions.h) is a four-dimensional point set of its own: its coordinates are scrambled
// with their own hashes, and its points have their own order, so that two slots are uncorrelated
// although both use the same four dimensions. The order is a nested uniform shuffle that preserves
// the highest set bit of the index: aligned power-of-two blocks stay such blocks, the first 2^k
// samples stay the first 2^k, and small indices stay small, which keeps lookups few.
// sampler_test.cc and tests/stability measure the loss of quality (none is detectable).
//
// Source: Owen 1995; Laine and Karras 2011 (hash); Burley 2020, "Practical Hash-based Owen
// Scrambling", JCGT 9(4) (padding, shuffling); constants of the hash: Vegdahl 2021, "Building a
// Better LK Hash" (also pbrt-v4).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/film/film_tile.h"
#include "common/math/mix_bits.h"
#include "common/math/vec.h"
#include "worker/render/sampling/sobol_points.h"

namespace sheaf::render {

namespace sobol {

// Owen scrambling of a bit-reversed word: a bit flips depending only on the bits below it and on
// the seed.
constexpr uint32_t ScrambleReversed(uint32_t v, uint32_t seed) {
  v ^= v * 0x3d20adeau;
  v += seed;
  v *= (seed >> 16) | 1u;
  v ^= v * 0x05526c56u;
  v ^= v * 0x53a22864u;
  return v;
}

// The same for a 64-bit index; bits up to and including the lowest set one (the highest of the
// index) are preserved, and so is 0. Any even multiplier gives a valid scramble; these extend the
// 32-bit ones to 64 bits.
constexpr uint64_t ShuffleReversedIndex(uint64_t v, uint64_t seed) {
  const uint64_t may_flip = ~(v ^ (v - 1));
  uint64_t s = v;
  s ^= s * 0x8ad71f3c3d20adeau;
  s += seed;
  s *= (seed >> 32) | 1u;
  s ^= s * 0xb7a2c91d05526c56u;
  s ^= s * 0x61e4a8f753a22864u;
  return v ^ ((s ^ v) & may_flip);
}

constexpr uint32_t ReverseBits(uint32_t v) {
  v = ((v >> 1) & 0x55555555u) | ((v & 0x55555555u) << 1);
  v = ((v >> 2) & 0x33333333u) | ((v & 0x33333333u) << 2);
  v = ((v >> 4) & 0x0f0f0f0fu) | ((v & 0x0f0f0f0fu) << 4);
  return __builtin_bswap32(v);
}

constexpr uint64_t ReverseBits64(uint64_t v) {
  return (uint64_t{ReverseBits(static_cast<uint32_t>(v))} << 32) |
         ReverseBits(static_cast<uint32_t>(v >> 32));
}

// The top 24 bits: all that a float in [0, 1) can hold, so rounding never gives 1.
constexpr float UnitFloat(uint32_t bits) {
  return static_cast<float>(static_cast<int32_t>(bits >> 8)) * 0x1p-24f;
}

}  // namespace sobol

class Sampler {
 public:
  // sample_index is the film's: it determines the replicate and the index within it. one_sequence:
  // use a single replicate, whose scramble differs from all of the film's.
  Sampler(uint64_t seed, int32_t pixel_x, int32_t pixel_y, uint64_t sample_index,
          bool one_sequence = false)
      : index_reversed_(
            sobol::ReverseBits64(one_sequence ? sample_index : IndexInReplicate(sample_index))) {
    const uint64_t pixel =
        (uint64_t{static_cast<uint32_t>(pixel_y)} << 32) | static_cast<uint32_t>(pixel_x);
    // One full mix per input: in sums of raw inputs, seeds and pixels could cancel.
    key_ = MixBits(seed + 1);
    key_ = MixBits(key_ ^ pixel);
    key_ = MixBits(key_ + (one_sequence ? kReplicateCount : ReplicateOf(sample_index)) + 1);
  }

  // The numbers of a path that split off from the sample's: the same points in another order and
  // with other scrambles. number: of the path within the sample, from 1.
  Sampler OfSplitPath(uint32_t number) const {
    Sampler sampler = *this;
    sampler.key_ = MixBits(key_ ^ MixBits(kSplitPaths + number));
    return sampler;
  }

  // All four coordinates of a slot. Values are multiples of 2^-24 in [0, 1), never 1.
  std::array<float, 4> Get4(uint32_t slot) const {
    const uint64_t base = SlotBase(slot);
    const SobolPoint point = Point(base);
    const uint64_t seed01 = MixBits(base + kSeed01), seed23 = MixBits(base + kSeed23);
    return {Coordinate(point, 0, seed01), Coordinate(point, 1, seed01 >> 32),
            Coordinate(point, 2, seed23), Coordinate(point, 3, seed23 >> 32)};
  }
  // The first two of Get4's coordinates.
  Vec2f Get2(uint32_t slot) const {
    const uint64_t base = SlotBase(slot);
    const SobolPoint point = Point(base);
    const uint64_t seed01 = MixBits(base + kSeed01);
    return {Coordinate(point, 0, seed01), Coordinate(point, 1, seed01 >> 32)};
  }
  // The first of Get4's coordinates.
  float Get1(uint32_t slot) const {
    const uint64_t base = SlotBase(slot);
    // Sobol's first dimension is the bit-reversed index, and reversing this word gives the index
    // again.
    const uint64_t shuffled = sobol::ShuffleReversedIndex(index_reversed_, MixBits(base));
    const uint32_t reversed = FirstCoordinateReversed(shuffled);
    const uint32_t seed = static_cast<uint32_t>(MixBits(base + kSeed01));
    return sobol::UnitFloat(sobol::ReverseBits(sobol::ScrambleReversed(reversed, seed)));
  }

 private:
  // Odd constants (fractional parts of the golden ratio, pi and e) that keep hash inputs apart.
  static constexpr uint64_t kSlotStride = 0x9e3779b97f4a7c15u;
  static constexpr uint64_t kSeed01 = 0x243f6a8885a308d3u;
  static constexpr uint64_t kSeed23 = 0xb7e151628aed2a6bu;
  static constexpr uint64_t kSplitPaths = 0x73706c6974u;

  uint64_t SlotBase(uint32_t slot) const { return key_ + (slot + 1) * kSlotStride; }
  SobolPoint Point(uint64_t base) const {
    return SobolPointOfReversedIndex(sobol::ShuffleReversedIndex(index_reversed_, MixBits(base)));
  }
  static uint32_t FirstCoordinateReversed(uint64_t index_reversed) {
    return sobol::ReverseBits(static_cast<uint32_t>(index_reversed >> 32));
  }
  static float Coordinate(const SobolPoint& point, size_t d, uint64_t seed) {
    return sobol::UnitFloat(sobol::ReverseBits(
        sobol::ScrambleReversed(point.reversed[d], static_cast<uint32_t>(seed))));
  }

  uint64_t key_ = 0;             // Hash of seed, pixel and replicate.
  uint64_t index_reversed_ = 0;  // Index within the replicate, bits in reversed order.
};

}  // namespace sheaf::render
