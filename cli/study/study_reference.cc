// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/study_reference.h"

#include <utility>

#include "common/base/check.h"

namespace sheaf::cli {
namespace {

// Dark pixels count against this fraction of the image's mean, as in `sheaf compare`.
constexpr double kDarkFraction = 0.1;

std::vector<TilePixels> Sum(const std::vector<TilePixels>& camera,
                            const std::vector<TilePixels>& light) {
  SHEAF_CHECK(camera.size() == light.size());
  std::vector<TilePixels> sum = camera;
  for (size_t tile = 0; tile < sum.size(); ++tile) AddPixels(light[tile], &sum[tile]);
  return sum;
}

double MeanOfPixels(const std::vector<TilePixels>& tiles) {
  double sum = 0, count = 0;
  for (const TilePixels& tile : tiles) {
    for (const std::array<float, 3>& value : tile.value) {
      for (const float v : value) sum += static_cast<double>(v);
      count += 3;
    }
  }
  return sum / count;
}

}  // namespace

// Sum over the pixels of a tile of a squared error e(channel, pixel) of R, G and B, relative to the
// frame's truth.
template <typename SquaredError>
double StudyReference::RelativeSum(size_t tile, const SquaredError& squared_error) const {
  const double floor = kDarkFraction * mean_;
  const std::vector<std::array<float, 3>>& truth = frame_.tiles[tile].value;
  double sum = 0;
  for (size_t p = 0; p < truth.size(); ++p) {
    for (size_t c = 0; c < 3; ++c) {
      const double r = truth[p][c];
      const double divisor = r * r + floor * floor;
      if (divisor > 0) sum += squared_error(c, p) / divisor / 3;
    }
  }
  return sum;
}

StudyReference::StudyReference(std::vector<TilePixels> camera)
    : mean_(MeanOfPixels(camera)), frame_{std::move(camera), {}} {
  Measure(&frame_);
}

StudyReference::StudyReference(const std::vector<TilePixels>& camera,
                               const std::vector<TilePixels>& light,
                               const std::vector<TilePixels>& small_light)
    : frame_{Sum(camera, light), {}}, small_{Sum(camera, small_light), {}} {
  mean_ = MeanOfPixels(frame_.tiles);
  Measure(&frame_);
  Measure(&small_);
}

void StudyReference::Measure(Truth* truth) const {
  for (size_t tile = 0; tile < truth->tiles.size(); ++tile) {
    truth->variance.push_back(VarianceOf(tile, truth->tiles[tile]));
  }
}

double StudyReference::RelativeMse() const {
  double error = 0, count = 0;
  for (const TilePixels& tile : frame_.tiles) count += static_cast<double>(tile.value.size());
  for (const double variance : frame_.variance) error += variance / count;
  return error;
}

double StudyReference::VarianceOf(size_t tile, const TilePixels& pixels) const {
  return RelativeSum(tile, [&](size_t c, size_t p) {
    const double d = pixels.deviation[p][c];
    return d * d;
  });
}

double StudyReference::ErrorOf(size_t tile, const TilePixels& pixels, bool has_light) const {
  const Truth& truth = has_light ? small_ : frame_;
  const std::vector<std::array<float, 3>>& values = truth.tiles[tile].value;
  const double error = RelativeSum(tile, [&](size_t c, size_t p) {
    const double d = static_cast<double>(pixels.value[p][c]) - static_cast<double>(values[p][c]);
    return d * d;
  });
  return error - truth.variance[tile];
}

absl::Status RenderBlocks(TileRenderer* renderer, uint64_t blocks,
                          const std::function<bool()>& may_go_on) {
  for (uint64_t i = 0; i < blocks && (i < 2 || may_go_on()); ++i) {
    if (absl::Status status = renderer->RenderBlock(); !status.ok()) return status;
  }
  return absl::OkStatus();
}

std::vector<TilePixels> DevelopAll(const TileRenderer& renderer, size_t tile_count) {
  std::vector<TilePixels> tiles;
  for (size_t tile = 0; tile < tile_count; ++tile) tiles.push_back(renderer.Develop(tile));
  return tiles;
}

std::vector<TilePixels> LightOfTiles(const FrameImage& light, const std::vector<PixelRect>& tiles,
                                     int32_t frame_width_px, int32_t frame_height_px) {
  std::vector<TilePixels> pixels;
  for (const PixelRect& tile : tiles) {
    pixels.push_back(PixelsOf(LightOf(light, tile, frame_width_px, frame_height_px)));
  }
  return pixels;
}

}  // namespace sheaf::cli
