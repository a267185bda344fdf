// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightPassAccumulator: the sums of a block of light passes (task_kind.h), the counterpart of
// PixelAccumulator. A pass is one sample of every pixel: its value is the sum of the splats of all
// of the pass's light paths on that pixel, in the order of the paths, and its weight is 1. A pass
// is a leaf of the canonical tree (film_tile.h), so the bits of a block do not depend on how passes
// were divided into tasks.
//
// Memory: besides the tile, 24 bytes a pixel for each of the sums that are under way, at most
// 1 + log2 of the number of passes, as much again for each light group, and twice as much for the
// bias.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/film/film_tile.h"
#include "common/math/vec.h"

namespace sheaf {

// Use: for each pass of the block, in ascending order, Add its splats, then EndPass; at last
// Finish. Thread safety: none; the tile must outlive it.
class LightPassAccumulator {
 public:
  // Each replicate has one pass, so replicates need no trees. Larger blocks are merged from those
  // of this size (TileTree).
  static constexpr uint64_t kPassesMax = kReplicateCount;

  // Requires: the tile is empty, and its block has at most kPassesMax samples.
  explicit LightPassAccumulator(FilmTile* tile);

  // Adds value times weight to a pixel of the frame; those outside of the tile get nothing. group:
  // the light group, or the layer of a kind of path, that the splat belongs to; none if the tile's
  // outputs have no such. A splat that is not finite, or makes the pass's sum larger than
  // kSampleMagnitudeMax, is in no sum, but counted in the pixel's kNonFiniteCount.
  // Requires: group is below the number of light groups.
  void Add(int32_t x, int32_t y, const Rgb& value, float weight, std::optional<size_t> group);
  // Adds to the estimate of the bias of a pixel's value in the pass. A no-op outside of the
  // tile, for values that are not finite, and in tiles without HasMergeBias.
  void AddBias(int32_t x, int32_t y, const Rgb& bias);
  // Counts a splat that is not finite and of which no pixel is known, in the tile's first pixel.
  void CountLost() { ++tile_->channel(FilmChannel::kNonFiniteCount)[0]; }
  void EndPass();
  // Writes the sums into the tile. Requires: every pass of the block was ended.
  void Finish();

 private:
  // Sums of one node of the tree, values of DoubleFloats: [pixel][R, G, B, those of each group, of
  // the bias, and of the bias in passes of even replicates].
  using Sums = std::vector<double>;

  FilmTile* const tile_;
  const size_t bias_at_;      // The first sum of a pixel's bias.
  const size_t stride_;       // Sums of a pixel.
  Sums pass_;                 // Sums of the pass under way.
  std::vector<Sums> stack_;   // Sums of complete nodes, as NodeStack in film_tile.cc has them.
  std::vector<Sums> unused_;  // Memory for further ones.
  uint64_t pass_count_ = 0;
};

}  // namespace sheaf
