// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/error/rare_layers.h"

#include <algorithm>
#include <array>
#include <cstddef>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"

namespace sheaf {
namespace {

using LayerPlanes = std::array<const std::vector<float>*, 3>;

LayerPlanes PlanesOf(const FrameImage& image, const std::string& prefix) {
  LayerPlanes planes;
  for (size_t c = 0; c < 3; ++c) {
    planes[c] = image.Find(prefix + "RGB"[c]);
    SHEAF_CHECK(planes[c] != nullptr);
  }
  return planes;
}

// The squared difference of one layer at one pixel, summed over R, G and B.
double SquaredDifference(const LayerPlanes& layer, const PixelRect& window, int32_t x, int32_t y) {
  double sum = 0;
  for (const std::vector<float>* plane : layer) {
    double about = 0;
    int count = 0;
    for (int32_t py = std::max(y - 1, window.y0); py < std::min(y + 2, window.y1); ++py) {
      for (int32_t px = std::max(x - 1, window.x0); px < std::min(x + 2, window.x1); ++px) {
        if (px == x && py == y) continue;
        about += (*plane)[window.IndexOf(px, py)];
        ++count;
      }
    }
    const double difference = (*plane)[window.IndexOf(x, y)] - (count == 0 ? 0 : about / count);
    sum += difference * difference;
  }
  return sum;
}

// The index of the layer responsible for the tile's error.
size_t RareLayerOf(const std::vector<LayerPlanes>& layers, const LayerPlanes& errors,
                   const PixelRect& window, const PixelRect& tile) {
  std::vector<double> fractions(layers.size()), squares(layers.size());
  for (int32_t y = tile.y0; y < tile.y1; ++y) {
    for (int32_t x = tile.x0; x < tile.x1; ++x) {
      const size_t p = window.IndexOf(x, y);
      double variance = 0;
      for (const std::vector<float>* plane : errors) variance += double{(*plane)[p]} * (*plane)[p];
      if (variance == 0) continue;
      double all = 0;
      for (size_t i = 0; i < layers.size(); ++i) {
        squares[i] = SquaredDifference(layers[i], window, x, y);
        all += squares[i];
      }
      if (all == 0) continue;
      for (size_t i = 0; i < layers.size(); ++i) fractions[i] += variance * squares[i] / all;
    }
  }
  return static_cast<size_t>(std::max_element(fractions.begin(), fractions.end()) -
                             fractions.begin());
}

}  // namespace

std::vector<LayerCount> RareLayers(const FrameImage& image, std::span<const PixelRect> tiles) {
  const std::vector<std::string>& names = image.outputs.light_groups;
  if (names.empty()) return {};
  std::vector<LayerPlanes> layers;
  for (const std::string& name : names) layers.push_back(PlanesOf(image, absl::StrCat(name, ".")));
  const LayerPlanes errors = PlanesOf(image, "stderr.");
  std::vector<LayerCount> counts;
  for (const std::string& name : names) counts.push_back({name, 0});
  for (const PixelRect& tile : tiles) {
    ++counts[RareLayerOf(layers, errors, image.window, tile)].tile_count;
  }
  std::erase_if(counts, [](const LayerCount& count) { return count.tile_count == 0; });
  std::stable_sort(counts.begin(), counts.end(), [](const LayerCount& a, const LayerCount& b) {
    return a.tile_count > b.tile_count;
  });
  return counts;
}

}  // namespace sheaf
