// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RunningError: a picture's relMSE while it grows, for people who watch. Of each change only the
// tiles that changed are looked at, so that a large picture can be watched as often as a small one.
// A tile's error is as of its last change: what its neighbours and the picture's mean have become
// since is left out, and what RareHits add to variances. Decisions are made by EstimateTileErrors.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/film/error/error_estimate.h"

namespace sheaf {

// Thread safety: none.
class RunningError {
 public:
  // R, G and B of pixels with samples.
  struct Values {
    double sum = 0, count = 0;
  };
  // tiles: of the picture, without overlap.
  explicit RunningError(std::vector<PixelRect> tiles);

  // `changed`: indices of the tiles that differ from the last call.
  void Update(const FramePicture& picture, std::span<const uint32_t> changed);
  // 0 until there are samples.
  double RelativeMse() const { return sum_.RelativeMse(); }
  std::vector<ErrorSums> OfTiles() const;

 private:
  struct Tile {
    PixelRect rect;
    Values values;
    ErrorSums error;
  };
  std::vector<Tile> tiles_;
  Values values_;  // Of all tiles.
  ErrorSums sum_;
};

}  // namespace sheaf
