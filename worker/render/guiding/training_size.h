// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The size of a training: guiding_training.h.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>

namespace sheaf::render {

// The first iteration traces a path for each second pixel of the whole frame, within these limits,
// rounded down to a power of two.
inline constexpr uint64_t kTrainingPathsFirstMin = uint64_t{1} << 13;
inline constexpr uint64_t kTrainingPathsFirstMax = uint64_t{1} << 17;
// Width and height are those of the whole frame, so that a crop learns the same.
constexpr uint64_t TrainingPathsFirst(int32_t width_px, int32_t height_px) {
  const uint64_t pixels = static_cast<uint64_t>(width_px) * static_cast<uint64_t>(height_px);
  return std::clamp(std::bit_floor(pixels / 2), kTrainingPathsFirstMin, kTrainingPathsFirstMax);
}
// Each further iteration traces twice as many. Then 2^kLightsShift times as many as in the first
// one learn which lights are hidden: 17 times as many in all, at most eight and a half samples a
// pixel of the frame, and in full HD about one.
inline constexpr uint32_t kTrainingIterations = 4;
inline constexpr int kLightsShift = 1;
// As many learn lights alone, without guiding: at most a path for each pixel, 1.6 % of the paths of
// 64 samples.
// Where paths are split, each of this many passes traces 2^kContributionsShift times as many as the
// first iteration, to learn what they contribute; the second pass, split by what the first
// found: 25 times as many as in the first iteration in all.
inline constexpr uint32_t kContributionPasses = 2;
inline constexpr int kContributionsShift = 2;
// Where emission is guided, this many iterations of light paths, the first of as many as the first
// one of camera paths, and each of twice as many as the last: 7 times as many in all.
inline constexpr uint32_t kEmissionIterations = 3;

}  // namespace sheaf::render
