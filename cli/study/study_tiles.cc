// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/study_tiles.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "common/base/first_error.h"
#include "common/base/parallel.h"
#include "common/film/light/light_image.h"

namespace sheaf::cli {
namespace {

constexpr const char* kColorChannels[3] = {"R", "G", "B"};
constexpr const char* kErrorChannels[3] = {"stderr.R", "stderr.G", "stderr.B"};
// Empty rows between packed tiles: errors are estimated from neighbors up to 2 pixels away.
constexpr int32_t kPackGapPx = 2;

}  // namespace

absl::Status ForEachTile(int threads, size_t count,
                         const std::function<absl::Status(size_t)>& work) {
  FirstError failure;
  ParallelRanges(count, 1, threads, [&](uint64_t i, uint64_t) {
    absl::Status status = work(i);
    if (!status.ok()) failure.Update(std::move(status));
  });
  return failure.Get();
}

std::vector<PixelRect> ChooseTiles(const PixelRect& window, size_t count) {
  const std::vector<PixelRect> all = CutTiles(window, kStudyTilePx);
  count = std::min(count, all.size());
  std::vector<PixelRect> tiles;
  tiles.reserve(count);
  for (size_t i = 0; i < count; ++i) tiles.push_back(all[(2 * i + 1) * all.size() / (2 * count)]);
  return tiles;
}

TilePixels PixelsOf(const FrameImage& image) {
  const auto count = static_cast<size_t>(image.window.PixelCount());
  TilePixels pixels{std::vector<std::array<float, 3>>(count),
                    std::vector<std::array<float, 3>>(count)};
  for (size_t c = 0; c < 3; ++c) {
    const std::vector<float>& value = *image.Find(kColorChannels[c]);
    const std::vector<float>& deviation = *image.Find(kErrorChannels[c]);
    for (size_t p = 0; p < count; ++p) {
      pixels.value[p][c] = value[p];
      pixels.deviation[p][c] = deviation[p];
    }
  }
  return pixels;
}

void AddPixels(const TilePixels& light, TilePixels* pixels) {
  for (size_t p = 0; p < pixels->value.size(); ++p) {
    for (size_t c = 0; c < 3; ++c) {
      pixels->value[p][c] += light.value[p][c];
      pixels->deviation[p][c] = std::hypot(pixels->deviation[p][c], light.deviation[p][c]);
    }
  }
}

TileRenderer::TileRenderer(const render::CompiledScene& scene, const std::vector<PixelRect>& tiles,
                           int threads, LightPasses* light)
    : scene_(scene), tiles_(tiles), threads_(threads), light_(light), cpu_seconds_(tiles.size()) {
  for (const PixelRect& tile : tiles) trees_.emplace_back(tile);
}

absl::Status TileRenderer::RenderBlock(const std::vector<uint64_t>* wanted, const OnPart& on_part) {
  absl::Status status = ForEachTile(threads_, tiles_.size(), [&](size_t tile) -> absl::Status {
    const uint64_t first = trees_[tile].SampleCount();
    if (wanted != nullptr && (*wanted)[tile] <= first) return absl::OkStatus();
    render::RenderStats stats;
    absl::StatusOr<FilmTile> part =
        RenderTilePass(scene_, tiles_[tile], {first, kStudyBlockSamples}, {}, &stats);
    if (!part.ok()) return part.status();
    cpu_seconds_[tile] += stats.cpu_seconds;
    if (on_part) on_part(tile, *part);
    return trees_[tile].Insert(*std::move(part));
  });
  if (!status.ok() || light_ == nullptr) return status;
  uint64_t most = 0;
  for (const TileTree& tree : trees_) most = std::max(most, tree.SampleCount());
  return light_->RenderUntil(most);
}

double TileRenderer::CpuSeconds() const {
  return std::accumulate(cpu_seconds_.begin(), cpu_seconds_.end(), 0.0);
}

FrameImage TileRenderer::DevelopImage(size_t tile) const {
  const FrameSettings& settings = SettingsOf(scene_);
  FrameImage image =
      MakeFrameImage(tiles_[tile], settings.width_px, settings.height_px, settings.outputs);
  DevelopTile(trees_[tile].Root(), &image);
  if (light_ == nullptr) return image;
  const FrameImage light =
      LightOf(light_->Image(), tiles_[tile], settings.width_px, settings.height_px);
  FrameImage both = image;
  AddLight(image, light, tiles_[tile], &both);
  return both;
}

TilePixels TileRenderer::Develop(size_t tile) const { return PixelsOf(DevelopImage(tile)); }

FrameImage TileRenderer::Pack(std::vector<PixelRect>* rects) const {
  int32_t width = 0, height = 0;
  rects->clear();
  for (const PixelRect& tile : tiles_) {
    rects->push_back({0, height, tile.Width(), height + tile.Height()});
    width = std::max(width, tile.Width());
    height += tile.Height() + kPackGapPx;
  }
  FrameImage packed =
      MakeFrameImage({0, 0, width, height}, width, height, SettingsOf(scene_).outputs);
  for (size_t tile = 0; tile < tiles_.size(); ++tile) {
    const FrameImage image = DevelopImage(tile);
    const auto tile_width = static_cast<size_t>(tiles_[tile].Width());
    for (size_t plane = 0; plane < packed.planes.size(); ++plane) {
      for (int32_t y = 0; y < tiles_[tile].Height(); ++y) {
        const auto from = image.planes[plane].begin() +
                          static_cast<std::ptrdiff_t>(static_cast<size_t>(y) * tile_width);
        const size_t to = static_cast<size_t>((*rects)[tile].y0 + y) * static_cast<size_t>(width);
        std::copy_n(from, tile_width,
                    packed.planes[plane].begin() + static_cast<std::ptrdiff_t>(to));
      }
    }
  }
  return packed;
}

FrameImage TileRenderer::Join(const PixelRect& window) const {
  const FrameSettings& settings = SettingsOf(scene_);
  FrameImage image =
      MakeFrameImage(window, settings.width_px, settings.height_px, settings.outputs);
  for (const TileTree& tree : trees_) DevelopTile(tree.Root(), &image);
  return image;
}

}  // namespace sheaf::cli
