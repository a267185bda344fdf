// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PathArena: the stored camera paths of one light pass, in the order of their pixels.
#pragma once

#include <type_traits>
#include <vector>

#include "worker/render/gather/gather_grid.h"
#include "worker/render/gather/gather_point.h"

namespace sheaf::render {

// Thread-safe while no path is added.
class PathArena {
 public:
  // Keeps the memory for the next pass.
  void Clear() {
    balls_.clear();
    rgb_.clear();
    spectral_.clear();
  }
  // Makes room for `count` paths; memory that is not used is not touched.
  template <typename Color>
  void Reserve(size_t count) {
    balls_.reserve(count);
    Points<Color>().reserve(count);
  }
  template <typename Color>
  void Add(const GatherBall& ball, const GatherPointOf<Color>& point) {
    balls_.push_back(ball);
    Points<Color>().push_back(point);
  }
  const std::vector<GatherBall>& balls() const { return balls_; }
  // Requires: a point of the color was added as number `index`.
  template <typename Color>
  const GatherPointOf<Color>& At(uint32_t index) const {
    if constexpr (std::is_same_v<Color, Rgb>) {
      return rgb_[index];
    } else {
      return spectral_[index];
    }
  }

 private:
  template <typename Color>
  std::vector<GatherPointOf<Color>>& Points() {
    if constexpr (std::is_same_v<Color, Rgb>) {
      return rgb_;
    } else {
      return spectral_;
    }
  }

  // One pass fills one of the last two.
  std::vector<GatherBall> balls_;
  std::vector<GatherPointOf<Rgb>> rgb_;
  std::vector<GatherPointOf<Spectral>> spectral_;
};

}  // namespace sheaf::render
