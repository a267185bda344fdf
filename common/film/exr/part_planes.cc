// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/exr/part_planes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace sheaf {
namespace {

// Three planes of sums: heads and, for double-floats, tails.
struct ColorPlanes {
  std::string name;
  std::array<const float*, 3> hi{}, lo{};
  double At(size_t component, size_t p) const {
    const double tail = lo[component] == nullptr ? 0 : double{lo[component][p]};
    return double{hi[component][p]} + tail;
  }
};

std::vector<ColorPlanes> ColorPlanesOf(const FilmTile& tile) {
  const auto main = [&](FilmChannel first, size_t i) {
    return tile.channel(static_cast<FilmChannel>(static_cast<size_t>(first) + i));
  };
  std::vector<ColorPlanes> colors(1);
  colors[0].name = "R, G, B";
  for (size_t i = 0; i < 3; ++i) {
    colors[0].hi[i] = main(FilmChannel::kRedHi, i);
    colors[0].lo[i] = main(FilmChannel::kRedLo, i);
  }
  for (uint32_t slot = 0; slot < tile.replicate_count(); ++slot) {
    ColorPlanes& color = colors.emplace_back();
    color.name = absl::StrFormat("r%02d", tile.replicate_first() + slot);
    for (size_t i = 0; i < 3; ++i) color.hi[i] = tile.replicate(slot, i);
  }
  const std::vector<MeanChannel> means = MeanChannelsOf(tile.outputs());
  for (size_t first = 0; first < means.size(); ++first) {
    if (!means[first].starts_color) continue;
    ColorPlanes& color = colors.emplace_back();
    color.name = means[first].name;
    for (size_t i = 0; i < 3; ++i) {
      color.hi[i] = tile.mean(first + i, 0);
      color.lo[i] = tile.mean(first + i, 1);
    }
  }
  return colors;
}

// Requires: counts are valid, all values finite. may_be_negative: also where no weight is.
std::string WhyNoLight(const FilmTile& tile, bool may_be_negative) {
  constexpr double kRounding = 1 + 1e-5;
  const float* samples = tile.channel(FilmChannel::kSampleCount);
  const float* weight = tile.channel(FilmChannel::kWeight);
  const float* weight_lo = tile.channel(FilmChannel::kWeightLo);
  for (const ColorPlanes& color : ColorPlanesOf(tile)) {
    for (size_t p = 0; p < tile.plane_size(); ++p) {
      const double most = double{kSampleMagnitudeMax} * kRounding * double{samples[p]};
      double sum = 0, magnitude = 0;
      for (size_t i = 0; i < 3; ++i) {
        const double value = color.At(i, p);
        if (std::fabs(value) > most) {
          return absl::StrCat("channel \"", color.name, "\" holds a sum of ", value, ", more than ",
                              samples[p], " samples can have");
        }
        sum += value;
        magnitude += std::fabs(value);
      }
      if (may_be_negative || sum >= -kNegativeFractionMax * magnitude) continue;
      const bool negative_weights = double{weight[p]} + double{weight_lo[p]} != double{samples[p]};
      if (negative_weights) continue;
      return absl::StrCat("channel \"", color.name, "\" holds negative light, a sum of ", sum,
                          ", though its filter has no negative weights");
    }
  }
  return "";
}

std::string WhyNotFinite(FilmTile& tile) {
  for (const auto& plane : PlanesOf<float>(tile)) {
    for (size_t p = 0; p < tile.plane_size(); ++p) {
      if (std::isfinite(plane.pixels[p])) continue;
      return absl::StrCat("channel \"", plane.name, "\" holds a value that is not finite");
    }
  }
  return "";
}

bool IsCount(float value) { return value >= 0 && value == std::floor(value); }

}  // namespace

std::string WhyNoSums(FilmTile& tile, const PixelLattice& lattice, const TileCells& cells) {
  if (std::string why = WhyNotFinite(tile); !why.empty()) return why;
  constexpr uint64_t kExactCountMax = 1 << 24;  // Larger floats skip integers.
  const float* samples = tile.channel(FilmChannel::kSampleCount);
  const float* nonfinite = tile.channel(FilmChannel::kNonFiniteCount);
  const PixelRect& rect = tile.rect();
  std::vector<char> chosen(tile.plane_size());
  for (const PixelRect& cell : RectsOf(rect, cells)) {
    for (int32_t y = cell.y0; y < cell.y1; ++y) {
      std::fill_n(chosen.begin() + static_cast<ptrdiff_t>(rect.IndexOf(cell.x0, y)), cell.Width(),
                  char{1});
    }
  }
  size_t p = 0;
  for (int32_t y = rect.y0; y < rect.y1; ++y) {
    for (int32_t x = rect.x0; x < rect.x1; ++x, ++p) {
      const uint64_t count =
          chosen[p] == 0 ? 0 : lattice.SamplesOf(lattice.PartOf(x, y), tile.block()).count;
      const bool adds_up =
          count > kExactCountMax || samples[p] + nonfinite[p] == static_cast<float>(count);
      if (!IsCount(samples[p]) || nonfinite[p] < 0 || !adds_up) return "wrong sample counts";
    }
  }
  return WhyNoLight(tile, /*may_be_negative=*/false);
}

std::string WhyNoLightPasses(FilmTile& tile) {
  if (std::string why = WhyNotFinite(tile); !why.empty()) return why;
  constexpr std::array kUnused{FilmChannel::kWeightLo, FilmChannel::kAlpha,   FilmChannel::kAlbedoR,
                               FilmChannel::kAlbedoG,  FilmChannel::kAlbedoB, FilmChannel::kNormalX,
                               FilmChannel::kNormalY,  FilmChannel::kNormalZ, FilmChannel::kDepth};
  const auto count = static_cast<float>(tile.block().count);
  for (size_t p = 0; p < tile.plane_size(); ++p) {
    const bool counts = tile.channel(FilmChannel::kSampleCount)[p] == count &&
                        tile.channel(FilmChannel::kWeight)[p] == count &&
                        IsCount(tile.channel(FilmChannel::kNonFiniteCount)[p]);
    if (!counts) return "wrong counts of light passes";
    const bool is_unused = std::ranges::all_of(
        kUnused, [&](FilmChannel channel) { return tile.channel(channel)[p] == 0; });
    if (!is_unused) return "light passes with surfaces";
  }
  return WhyNoLight(tile, /*may_be_negative=*/true);
}

}  // namespace sheaf
