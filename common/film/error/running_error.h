// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RunningError: a growing image's relMSE, for display. After each change only the changed tiles are
// evaluated, so that a large image can be observed as often as a small one. A tile's error is as of
// its last change: later changes of its neighbors and of the image's mean are ignored, and so are
// the variances that RareHits adds. Decisions use EstimateTileErrors. A stereo image has one tile,
// with the errors of its worse eye.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/film/error/error_estimate.h"

namespace sheaf {

// Thread safety: none.
class RunningError {
 public:
  // Sums of R, G and B over pixels with samples.
  struct Values {
    double sum = 0, count = 0;
  };
  // tiles: of the image, without overlap.
  explicit RunningError(std::vector<PixelRect> tiles);

  // `changed`: indices of the tiles changed since the last call.
  void Update(const FrameImage& image, std::span<const uint32_t> changed);
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
  Values values_;  // Over all tiles.
  ErrorSums sum_;
};

}  // namespace sheaf
