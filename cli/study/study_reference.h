// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// StudyReference: the image that a study compares all others with, and their errors.
//
// Where the frame has light paths, the reference is the sum of its camera's paths and its light
// paths, both over the tiles of the frame itself. The light of a setting may be measured on the
// frame made smaller (light_passes.h), whose pixels show more of the scene than those of the frame.
// So it is compared with the reference's light on the same smaller frame; what it is relative to is
// the frame's own light.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "absl/status/statusor.h"
#include "cli/study/study_tiles.h"

namespace sheaf::cli {

class StudyReference {
 public:
  // camera: the reference's paths from the camera, by tile. Without light paths.
  explicit StudyReference(std::vector<TilePixels> camera);
  // With its light by tile: of the frame, and of the smaller frame as LightOf shows it. Requires:
  // as many tiles of each.
  StudyReference(const std::vector<TilePixels>& camera, const std::vector<TilePixels>& light,
                 const std::vector<TilePixels>& small_light);

  // Over R, G, B of all pixels of the tiles.
  double mean() const { return mean_; }
  // The reference's own squared error of a pixel, from its replicates.
  double RelativeMse() const;
  // The expected variance of other pixels of a tile, relative to the reference, as relMSE of `sheaf
  // compare` is, times the number of pixels.
  double VarianceOf(size_t tile, const TilePixels& pixels) const;
  // Their squared error without the reference's own. has_light: the pixels contain light that
  // LightOf shows, so it is compared with that of the smaller frame.
  double ErrorOf(size_t tile, const TilePixels& pixels, bool has_light) const;

 private:
  // Pixels to compare with, and their own variance, by tile.
  struct Truth {
    std::vector<TilePixels> tiles;
    std::vector<double> variance;
  };
  void Measure(Truth* truth) const;
  template <typename SquaredError>
  double RelativeSum(size_t tile, const SquaredError& squared_error) const;

  double mean_ = 0;
  Truth frame_;
  Truth small_;  // Empty without light paths.
};

// Renders blocks of all tiles until there are this many or may_go_on returns false, but at least
// two.
absl::Status RenderBlocks(TileRenderer* renderer, uint64_t blocks,
                          const std::function<bool()>& may_go_on);
// The tiles as rendered. Requires: all have samples.
std::vector<TilePixels> DevelopAll(const TileRenderer& renderer, size_t tile_count);
// The light of the tiles of a frame, from an image of it or of the frame made smaller.
std::vector<TilePixels> LightOfTiles(const FrameImage& light, const std::vector<PixelRect>& tiles,
                                     int32_t frame_width_px, int32_t frame_height_px);

}  // namespace sheaf::cli
