// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/study_crops.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "cli/image/tone_map.h"
#include "cli/study/study_tiles.h"
#include "common/film/error/error_estimate.h"
#include "common/film/light/light_image.h"
#include "common/image/image_io.h"

namespace sheaf::cli {
namespace {

constexpr int32_t kCropTilePx = 16;
constexpr int kRegionCount = 2;
// Sizes in pixels, multiples of a tile's, in order of preference.
constexpr std::pair<int32_t, int32_t> kSizes[] = {{192, 144}, {128, 96}, {96, 64}, {64, 48}};
// A factor of four in samples from price to price is easily seen; of two, if there is no time.
constexpr uint64_t kBlocksForFours = 64, kBlocksLeast = 8;
constexpr uint64_t kPriceCount = 4;

int32_t Place(int32_t first, int32_t size, int32_t begin, int32_t end) {
  return std::clamp(first, begin, std::max(begin, end - size));
}

PixelRect CropAround(const PixelRect& tile, const PixelRect& window, const CropPlan& plan) {
  const int32_t width = std::min(plan.width_px, window.Width());
  const int32_t height = std::min(plan.height_px, window.Height());
  const int32_t x = Place((tile.x0 + tile.x1 - width) / 2, width, window.x0, window.x1);
  const int32_t y = Place((tile.y0 + tile.y1 - height) / 2, height, window.y0, window.y1);
  return {x, y, x + width, y + height};
}

bool HasCenterOf(const PixelRect& rect, const PixelRect& tile) {
  const int32_t x = (tile.x0 + tile.x1) / 2, y = (tile.y0 + tile.y1) / 2;
  return x >= rect.x0 && x < rect.x1 && y >= rect.y0 && y < rect.y1;
}

bool Overlap(const PixelRect& a, const PixelRect& b) { return !Intersect(a, b).IsEmpty(); }

// A region and its mean error.
struct Candidate {
  PixelRect rect;
  double error = 0;
};

Candidate MakeCandidate(const PixelRect& rect, const std::vector<PixelRect>& tiles,
                        const std::vector<double>& errors,
                        const std::vector<double>& pixel_counts) {
  double error = 0, count = 0;
  for (size_t tile = 0; tile < tiles.size(); ++tile) {
    if (!HasCenterOf(rect, tiles[tile])) continue;
    error += errors[tile];
    count += pixel_counts[tile];
  }
  return {rect, count > 0 ? error / count : 0};
}

// Renderer of a region by tiles.
struct Region {
  std::vector<PixelRect> tiles;
  std::unique_ptr<TileRenderer> renderer;
};

// light: null if there is none.
absl::StatusOr<CropImage> MakeImage(const TileRenderer& renderer, const PixelRect& rect,
                                    const FrameImage* light) {
  FrameImage image = renderer.Join(rect);
  if (light != nullptr) {
    const FrameImage camera = image;
    AddLight(camera, LightOf(*light, rect, image.frame_width_px, image.frame_height_px), rect,
             &image);
  }
  absl::StatusOr<std::string> png = EncodePng(rect.Width(), rect.Height(), ToneMapSrgb(image));
  if (!png.ok()) return png.status();
  return CropImage{EstimateError(image).relative_mse, *std::move(png)};
}

}  // namespace

CropPlan PlanCrops(double tile_blocks, uint64_t blocks_max) {
  CropPlan plan;
  uint64_t blocks = 0;
  for (const auto& [width, height] : kSizes) {
    plan.width_px = width;
    plan.height_px = height;
    const double tiles = kRegionCount * (width / kCropTilePx) * (height / kCropTilePx);
    blocks = std::bit_floor(
        static_cast<uint64_t>(std::clamp(tile_blocks / tiles, 1.0, double{kCropBlocksMax})));
    if (blocks >= kBlocksForFours) break;
  }
  blocks = std::min(std::max(blocks, kBlocksLeast), std::bit_floor(blocks_max));
  const int step = blocks >= kBlocksForFours ? 2 : 1;
  for (uint64_t i = 0; i < kPriceCount; ++i) {
    const uint64_t fewer = blocks >> (static_cast<uint64_t>(step) * (kPriceCount - 1 - i));
    if (fewer > 0) plan.blocks.push_back(fewer);
  }
  return plan;
}

std::vector<CropRegion> ChooseCrops(const PixelRect& window, const CropPlan& plan,
                                    const std::vector<PixelRect>& tiles,
                                    const std::vector<double>& errors,
                                    const std::vector<double>& pixel_counts) {
  std::vector<Candidate> candidates;
  candidates.reserve(tiles.size());
  for (const PixelRect& tile : tiles) {
    candidates.push_back(
        MakeCandidate(CropAround(tile, window, plan), tiles, errors, pixel_counts));
  }
  const Candidate worst =
      *std::max_element(candidates.begin(), candidates.end(),
                        [](const auto& a, const auto& b) { return a.error < b.error; });
  const double whole = MakeCandidate(window, tiles, errors, pixel_counts).error;
  const auto distance = [whole](const Candidate& candidate) {
    return std::fabs(std::log((candidate.error + 1e-30) / (whole + 1e-30)));
  };
  std::optional<Candidate> usual;
  // Regions beside the first one come before those that overlap it.
  for (const bool may_overlap : {false, true}) {
    for (const Candidate& candidate : candidates) {
      if (candidate.rect == worst.rect) continue;
      if (!may_overlap && Overlap(candidate.rect, worst.rect)) continue;
      if (!usual || distance(candidate) < distance(*usual)) usual = candidate;
    }
    if (usual) break;
  }
  std::vector<CropRegion> regions = {{CropKind::kLargestError, worst.rect}};
  if (usual) regions.push_back({CropKind::kRepresentative, usual->rect});
  return regions;
}

absl::StatusOr<std::vector<StudyCrop>> RenderCrops(const render::CompiledScene& scene,
                                                   const std::vector<CropRegion>& regions,
                                                   const CropPlan& plan,
                                                   const std::vector<FrameImage>& light,
                                                   int threads,
                                                   const std::function<bool()>& may_go_on) {
  std::vector<StudyCrop> crops;
  // Renderers refer to the tiles, so these must not move.
  std::vector<Region> rendered(regions.size());
  for (size_t i = 0; i < regions.size(); ++i) {
    crops.push_back({regions[i], {}});
    rendered[i].tiles = CutTiles(regions[i].rect, kCropTilePx);
    rendered[i].renderer = std::make_unique<TileRenderer>(scene, rendered[i].tiles, threads);
  }
  uint64_t done = 0;
  for (size_t price = 0; price < plan.blocks.size(); ++price) {
    const uint64_t blocks = plan.blocks[price];
    for (; done < blocks; ++done) {
      if (done >= plan.blocks.front() && !may_go_on()) return crops;
      for (Region& region : rendered) {
        if (absl::Status status = region.renderer->RenderBlock(); !status.ok()) return status;
      }
    }
    for (size_t i = 0; i < regions.size(); ++i) {
      absl::StatusOr<CropImage> image = MakeImage(*rendered[i].renderer, regions[i].rect,
                                                  light.empty() ? nullptr : &light[price]);
      if (!image.ok()) return image.status();
      crops[i].images.push_back(*std::move(image));
    }
  }
  return crops;
}

}  // namespace sheaf::cli
