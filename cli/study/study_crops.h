// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Crops of the image for the page of a study: two regions, rendered with the given settings at four
// prices, so that users see the result of each price. The regions are that of the largest error,
// and one whose error is nearest to that of the whole image.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/frame_image.h"
#include "common/film/tile_geometry.h"
#include "worker/render/tile_pass.h"

namespace sheaf::cli {

enum class CropKind { kLargestError, kRepresentative };

struct CropRegion {
  CropKind kind = CropKind::kLargestError;
  PixelRect rect;
};

// The crop at one of the prices.
struct CropImage {
  // The error of the crop alone, estimated from its replicates. With one sequence it is an upper
  // estimate.
  double relative_mse = 0;
  std::string png;  // The bytes of a file, as `sheaf render --png` shows images.
};

struct StudyCrop {
  CropRegion region;
  std::vector<CropImage> images;  // In ascending order of samples.
};

// The size of both crops and the numbers of blocks (study_tiles.h) at which they are shown.
struct CropPlan {
  int32_t width_px = 0, height_px = 0;
  std::vector<uint64_t> blocks;  // Ascending powers of two.
};

// The most blocks of a crop; a power of two.
inline constexpr uint64_t kCropBlocksMax = 256;

// The largest crops, with the most samples, for the time in which this many blocks of tiles of
// 16 x 16 pixels can be rendered. The least size and number are returned for any time. blocks_max:
// for frames with light paths, how many blocks of light passes there are; with few there are fewer
// prices. Requires: blocks_max > 0.
CropPlan PlanCrops(double tile_blocks, uint64_t blocks_max = kCropBlocksMax);

// errors, pixel_counts: by tile, as in StudyCheckpoint. The regions lie in the window, around the
// centers of tiles; the second one is missing if it would be the first. Requires: there are tiles,
// all within the window.
std::vector<CropRegion> ChooseCrops(const PixelRect& window, const CropPlan& plan,
                                    const std::vector<PixelRect>& tiles,
                                    const std::vector<double>& errors,
                                    const std::vector<double>& pixel_counts);

// Renders the regions in turns. All crops get equal numbers of images: those of plan.blocks, or
// fewer, but at least one, if may_go_on returns false. light: empty, or images of the frame's light
// paths after each number of blocks, which are added. Errors: as RenderTilePass; kInternal if an
// image cannot be encoded.
absl::StatusOr<std::vector<StudyCrop>> RenderCrops(const render::CompiledScene& scene,
                                                   const std::vector<CropRegion>& regions,
                                                   const CropPlan& plan,
                                                   const std::vector<FrameImage>& light,
                                                   int threads,
                                                   const std::function<bool()>& may_go_on);

}  // namespace sheaf::cli
