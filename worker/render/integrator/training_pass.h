// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TrainingPass: the paths of one iteration of a training, spread evenly over the whole frame.
#pragma once

#include <cstdint>
#include <utility>

#include "worker/render/sampling/sampler.h"

namespace sheaf::render {

// Changes the seed of the sampler, so that training paths are independent of the image's samples.
inline constexpr uint64_t kTrainingSeed = 0x677569646564u;
// Changes the seed of the sampler, so that light paths are independent of camera samples.
inline constexpr uint64_t kLightPathSeed = 0x6c69676874706174u;

struct TrainingPass {
  uint64_t seed = 0;  // The frame's.
  uint32_t iteration = 0;
  int32_t width_px = 0, height_px = 0;  // The whole frame.

  // The numbers of a path: one sequence for all paths of the pass.
  Sampler SamplerOf(uint64_t path) const {
    return {seed ^ kTrainingSeed, static_cast<int32_t>(iteration), 0, path, /*one_sequence=*/true};
  }
  // The pixel through which a path begins. Source: Roberts 2018, the R2 sequence: multiples of 1/g
  // and 1/g^2, g^3 = g + 1, here as fractions of 2^64.
  std::pair<int32_t, int32_t> PixelOf(uint64_t path) const {
    const auto place = [&](uint64_t step, int32_t size_px) {
      const uint64_t fraction = (path + 1) * step;
      return static_cast<int32_t>(((fraction >> 32) * static_cast<uint64_t>(size_px)) >> 32);
    };
    return {place(0xc13fa9a902a6328fu, width_px), place(0x91e10da5c79e7b1du, height_px)};
  }
};

}  // namespace sheaf::render
