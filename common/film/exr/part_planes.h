// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The planes of a film tile, named as in a part (exr_codec.h).
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/film/film_tile.h"
#include "common/film/pixel_lattice.h"
#include "common/film/tile_cells.h"

namespace sheaf {

// In the order of FilmChannel.
inline constexpr std::array<const char*, kFilmChannelCount> kPartChannels{
    "R",        "G",         "B",        "weight",   "lo.R",     "lo.G",
    "lo.B",     "lo.weight", "A",        "albedo.R", "albedo.G", "albedo.B",
    "normal.X", "normal.Y",  "normal.Z", "depth.Z",  "samples",  "nonfinite"};

// A float32 plane that is written to, or read from, one channel.
template <typename Float>
struct NamedPlane {
  std::string name;
  Float* pixels = nullptr;
};

// The tile's planes with their channel names. Tile is FilmTile or const FilmTile.
template <typename Float, typename Tile>
std::vector<NamedPlane<Float>> PlanesOf(Tile& tile) {
  std::vector<NamedPlane<Float>> planes;
  for (size_t i = 0; i < kFilmChannelCount; ++i) {
    planes.push_back({kPartChannels[i], tile.channel(static_cast<FilmChannel>(i))});
  }
  const std::vector<MeanChannel> means = MeanChannelsOf(tile.outputs());
  for (size_t i = 0; i < means.size(); ++i) {
    planes.push_back({means[i].name, tile.mean(i, 0)});
    planes.push_back({absl::StrCat("lo.", means[i].name), tile.mean(i, 1)});
  }
  for (uint32_t slot = 0; slot < tile.replicate_count(); ++slot) {
    for (size_t i = 0; i < kReplicateChannelCount; ++i) {
      planes.push_back({absl::StrFormat("r%02d.%c", tile.replicate_first() + slot, "RGBW"[i]),
                        tile.replicate(slot, i)});
    }
  }
  return planes;
}

// A sum of colors that lie outside of sRGB may be negative in some component, but R + G + B of
// light is positive for each wavelength. A sum below minus this fraction of |R| + |G| + |B| is not
// light.
inline constexpr double kNegativeFractionMax = 0.25;
// Why these cannot be sums of samples of the pixels that lattice and cells select; empty if they
// can. Each pixel must have the samples of its block, each of at most kSampleMagnitudeMax, and no
// negative light unless the filter has negative weights, in which case the weights do not add up to
// the number of samples.
std::string WhyNoSums(FilmTile& tile, const PixelLattice& lattice, const TileCells& cells);
// Why these cannot be sums of light passes (light_pass_accumulator.h); empty if they can. Each
// pixel must have the block's passes, each of weight 1, no pass a sum above kSampleMagnitudeMax,
// and nothing of surfaces. Light may be negative: a splat's weight is the filter's, which is not in
// the sums.
std::string WhyNoLightPasses(FilmTile& tile);

}  // namespace sheaf
