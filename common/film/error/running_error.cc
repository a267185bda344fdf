// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/error/running_error.h"

#include "common/film/error/error_planes.h"
#include "common/film/error/eye_errors.h"

namespace sheaf {
namespace {

RunningError::Values ValuesOf(const ErrorPlanes& planes, const FrameImage& image,
                              const PixelRect& tile) {
  RunningError::Values values;
  for (int32_t y = tile.y0; y < tile.y1; ++y) {
    for (int32_t x = tile.x0; x < tile.x1; ++x) {
      const size_t p = image.window.IndexOf(x, y);
      if ((*planes.samples)[p] == 0) continue;
      for (size_t i = 0; i < 3; ++i) values.sum += (*planes.value[i])[p];
      values.count += 3;
    }
  }
  return values;
}

}  // namespace

RunningError::RunningError(std::vector<PixelRect> tiles) {
  tiles_.reserve(tiles.size());
  for (const PixelRect& rect : tiles) tiles_.push_back({rect, {}, {}});
}

std::vector<ErrorSums> RunningError::OfTiles() const {
  std::vector<ErrorSums> errors;
  errors.reserve(tiles_.size());
  for (const Tile& tile : tiles_) errors.push_back(tile.error);
  return errors;
}

void RunningError::Update(const FrameImage& image, std::span<const uint32_t> changed) {
  const ErrorPlanes planes(image);
  for (const uint32_t index : changed) {
    Tile& tile = tiles_[index];
    const Values values = ValuesOf(planes, image, tile.rect);
    values_.sum += values.sum - tile.values.sum;
    values_.count += values.count - tile.values.count;
    tile.values = values;
  }
  const double mean = values_.count == 0 ? 0 : values_.sum / values_.count;
  RareHits ignored;
  for (const uint32_t index : changed) {
    Tile& tile = tiles_[index];
    tile.error = HasEyeDifference(image) ? EstimateEyeErrors(image).OfWorse()
                                         : SumErrors(planes, image, tile.rect, mean, 0, &ignored);
  }
  sum_ = {};
  for (const Tile& tile : tiles_) sum_.Add(tile.error);
}

}  // namespace sheaf
