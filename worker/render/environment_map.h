// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EnvironmentMap: radiance from infinity as a square equal-area map, filtered bilinearly between
// texel centres with octahedral wrap. Sampling draws from exactly the function that is looked up:
// a bilinear map is the sum of one tent for each texel, all of the same area, so a texel is chosen
// by its luminance and a point by its tent, which goes on across the map's edges as the filter
// does. So the pdf is the looked-up luminance over its mean, wherever it is asked, and is positive
// wherever radiance is. Space: the light's own.
//
// Speed is a matter of cache misses. Choosing goes down in three steps: to a block of 16 x 16
// texels by cumulative sums that stay in the first caches, as there are few; to a tile of 4 x 4 of
// them by the block's line of 16 weights; and to a texel by the very lines from which its radiance
// is then read, as a tile is four cache lines, and a block a page of memory.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "common/math/vec.h"
#include "worker/render/discrete_distribution.h"

namespace sheaf::render {

class EnvironmentMap {
 public:
  // Look-ups in two steps: the first begins to fetch what the second will read, which is worth it
  // where something else is left to do in between.
  //
  // A direction's place in the map.
  struct Place {
    Vec2f st;
  };
  // Sample(u) will take one of the texels of this tile, whose first is (x, y); ux, uy in [0, 1) are
  // what is left of u.
  struct TileChoice {
    size_t x = 0, y = 0;
    double ux = 0, uy = 0;
  };

  // Shape: texels is row-major [size][size]; row 0 is t = 0.
  // Errors: kInvalidArgument naming the first texel that is negative or not finite.
  static absl::StatusOr<EnvironmentMap> Make(int size, const std::vector<Rgb>& texels);

  // d: unit.
  Place Locate(Vec3f d) const;
  Rgb Radiance(Place place) const;
  Rgb Radiance(Vec3f d) const { return Radiance(Locate(d)); }
  // Mean of the filtered map's luminance over the sphere; 0 for a black map.
  double mean_luminance() const { return mean_luminance_; }
  // Requires: mean_luminance() > 0.
  TileChoice ChooseTile(Vec2f u) const;
  // A unit direction. Requires: mean_luminance() > 0.
  Vec3d SampleIn(TileChoice tile) const;
  Vec3d Sample(Vec2f u) const { return SampleIn(ChooseTile(u)); }
  // Sample's pdf of a direction with this radiance. Measure: solid angle.
  double Pdf(Rgb radiance) const {
    return static_cast<double>(Luminance(radiance)) * pdf_per_luminance_;
  }
  // Illuminance of a plane facing +z by the rule of pbrt-v4, which takes the mean over all texels
  // where the hemisphere has half of them: half the photometric value.
  double PbrtIlluminance() const;
  size_t size_bytes() const;

 private:
  static constexpr int kTileSize = 4, kBlockSize = 16;  // In texels.
  // Row-major weights of a tile's texels, or of a block's tiles.
  using Grid = std::array<float, 16>;
  // Radiance and its luminance: what is added up four at a time.
  struct alignas(16) Texel {
    std::array<float, 4> rgbl{};
  };
  struct alignas(64) TexelRow {
    std::array<Texel, kTileSize> texels;
  };
  struct alignas(64) BlockWeights {
    Grid tile_means{};  // Of the texels' luminance.
  };
  struct Cell {
    size_t x, y;
  };
  static Cell PickCell(const Grid& weights, double* ux, double* uy);

  // Requires: 0 <= x, y < size.
  size_t BlockIndex(size_t x, size_t y) const {
    return y / kBlockSize * blocks_across_ + x / kBlockSize;
  }
  // Of the tile's first row.
  size_t TileIndex(size_t x, size_t y) const {
    constexpr size_t kTilesAcross = kBlockSize / kTileSize;
    const size_t in_block =
        y / kTileSize % kTilesAcross * kTilesAcross + x / kTileSize % kTilesAcross;
    return (BlockIndex(x, y) * kTilesAcross * kTilesAcross + in_block) * kTileSize;
  }
  const Texel& At(int x, int y) const {
    const auto ux = static_cast<size_t>(x), uy = static_cast<size_t>(y);
    return rows_of_tiles_[TileIndex(ux, uy) + uy % kTileSize].texels[ux % kTileSize];
  }
  Grid TexelWeights(size_t tile_index) const;
  void BuildDistribution();
  // The texels of Bilinear(x, y), unless it lies at the map's edge.
  void Prefetch(Vec2d p) const;
  // Centres at integers.
  Vec2d TexelCoordinates(Vec2f st) const;
  // Radiance at texel coordinates, -0.5 <= x, y <= size - 0.5.
  Rgb Bilinear(double x, double y) const;

  int size_ = 0;
  size_t blocks_across_ = 0;
  std::vector<TexelRow> rows_of_tiles_;  // Of whole blocks: black beyond the map's edges.
  std::vector<BlockWeights> blocks_;     // [blocks_across_][blocks_across_].
  double mean_luminance_ = 0;
  double pdf_per_luminance_ = 0;  // 1 / (4 pi mean).
  DiscreteDistribution block_rows_;
  std::vector<DiscreteDistribution> block_columns_;  // For each row, the blocks in it.
};

}  // namespace sheaf::render
