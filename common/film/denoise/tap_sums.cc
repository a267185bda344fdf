// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/denoise/tap_sums.h"

#include <cstring>

namespace sheaf {
namespace {

// Student's quantile of this level for the reciprocal x of the degrees of freedom is
// kT0 + x (kT1 + x (kT2 + x kT3)), the first terms of Fisher's expansion. It is within 1 % for 5
// degrees of freedom and more, and too small for fewer, which makes the test stricter. Source:
// Abramowitz and Stegun 1964, Handbook of Mathematical Functions, 26.7.5.
// The quantile of a two-sided level of 5 %.
constexpr double kZ = 1.959964, kZ2 = kZ * kZ;
constexpr auto kT0 = static_cast<float>(kZ);
constexpr auto kT1 = static_cast<float>(kZ * (kZ2 + 1) / 4);
constexpr auto kT2 = static_cast<float>(kZ * ((5 * kZ2 + 16) * kZ2 + 3) / 96);
constexpr auto kT3 = static_cast<float>(kZ * (((3 * kZ2 + 19) * kZ2 + 17) * kZ2 - 15) / 384);
// Keeps quotients of variances that are 0 finite.
constexpr float kTiny = 1e-30F;

// A block's values, as the compilers' vector type: elementwise arithmetic, rounded as that of
// floats; comparisons give masks.
using Block = float __attribute__((vector_size(kBlockSize * sizeof(float))));
using Mask = int32_t __attribute__((vector_size(kBlockSize * sizeof(float))));

Block Load(const float* from) {
  Block block;
  std::memcpy(&block, from, sizeof(block));
  return block;
}

// The block where the mask is set, otherwise 0.
Block Where(Mask mask, Block block) { return (Block)((Mask)block & mask); }

// Where Welch's test does not tell means apart. Nowhere for values that are not finite.
Mask AreAlike(Block difference, Block variance, Block spread) {
  const Block x = spread / (variance * variance + kTiny);
  const Block t = kT0 + x * (kT1 + x * (kT2 + x * kT3));
  return difference * difference <= t * t * variance;
}

Block GuideWeight(const float* pixel, const float* neighbor, size_t stride) {
  Block distance{};
  for (size_t k = 0; k < kGuideCount; ++k) {
    const size_t plane = (kGuidePlane + k) * stride;
    const Block d = Load(neighbor + plane) - Load(pixel + plane);
    distance += d * d;
  }
  const Block d = Load(neighbor + kDepthPlane * stride) - Load(pixel + kDepthPlane * stride);
  const size_t scale = kDepthScalePlane * stride;
  distance += d * d * (Load(neighbor + scale) + Load(pixel + scale));
  const Block rest = 1.0F - distance;
  return Where(rest > 0.0F, rest * rest);
}

}  // namespace

FeatureRows::FeatureRows(size_t width, size_t height)
    : stride_((width + kBlockSize - 1) / kBlockSize * kBlockSize + 2 * kTapReach),
      values_(stride_ * kFeatureCount * (height + 2 * kTapReach)) {}

TapSums SumTaps(const float* pixel, size_t stride, std::span<const Tap> taps) {
  Block sums[kFilterCount][2][4] = {};
  for (const Tap& tap : taps) {
    const float* neighbor = pixel + tap.offset;
    Block difference[2][3];
    Mask alike[2];
    for (size_t half = 0; half < 2; ++half) {
      for (size_t i = 0; i < 3; ++i) {
        const size_t k = half * 3 + i;
        const auto sum = [&](size_t plane) {
          return Load(pixel + (plane + k) * stride) + Load(neighbor + (plane + k) * stride);
        };
        const size_t mean = (kMeanPlane + k) * stride;
        difference[half][i] = Load(neighbor + mean) - Load(pixel + mean);
        const Mask in_channel =
            AreAlike(difference[half][i], sum(kVariancePlane), sum(kSpreadPlane));
        alike[half] = i == 0 ? in_channel : alike[half] & in_channel;
      }
    }
    const Block guide = GuideWeight(pixel, neighbor, stride);
    const Block weight = tap.weight * Load(neighbor + kValidPlane * stride);
    for (size_t half = 0; half < 2; ++half) {
      const Block unguided = Where(alike[half], weight);
      const Block guided = unguided * guide;
      for (size_t i = 0; i < 3; ++i) {
        sums[kGuided][half][i] += guided * difference[1 - half][i];
        sums[kUnguided][half][i] += unguided * difference[1 - half][i];
      }
      sums[kGuided][half][3] += guided;
      sums[kUnguided][half][3] += unguided;
    }
  }
  TapSums result;
  static_assert(sizeof(result.sums) == sizeof(sums));
  std::memcpy(result.sums, sums, sizeof(sums));
  return result;
}

}  // namespace sheaf
