// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The errors of a frame's denoised layer (docs/denoise.md) before it is rendered. A pilot renders
// small crops of the frame at full size, with kDenoisedPilotSamples, because the filter uses the
// pixels around each one. It measures the error of their image, and the expected error of their
// denoised layer.
//
// The more samples an image has, the less noise is left to remove. So the error of the layer falls
// as 1 / n^kDenoisedRate, more slowly than the image's, from the pilot's on. It is bounded on both
// sides: the layer is at best as many times better as in the pilot, and at worst as bad as the
// image. In eight scenes, from 16 to 64 samples, the rate is 0.12 to 0.93, and the median is the
// constant. In ten scenes at 16 samples, this gain is 0.5 to 1.8 times the true one of relMSE.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/film/frame_image.h"
#include "common/film/tile_geometry.h"
#include "coordinator/forecast/cost_forecast.h"

namespace sheaf::cli {

inline constexpr uint64_t kDenoisedPilotSamples = 16;
// Crops of a pilot, and their edges in pixels: the filter reaches 8 pixels.
inline constexpr int32_t kDenoisedCropsPerAxis = 2;
inline constexpr int32_t kDenoisedCropPxMin = 32, kDenoisedCropPxMax = 64;
// The crops' pixels are at most this share of the frame's.
inline constexpr double kDenoisedCropShare = 0.02;
inline constexpr double kDenoisedRate = 0.65;

// The crops: the same distance from each other and from the borders. None if they would be smaller
// than kDenoisedCropPxMin.
std::vector<PixelRect> DenoisedCrops(const PixelRect& window);

// Values of relMSE at kDenoisedPilotSamples.
struct DenoisedPilot {
  double image = 0, denoised = 0;
  // The image's error over the denoised layer's.
  double Gain() const { return denoised > 0 && image > denoised ? image / denoised : 1; }
};
// From the images of the crops, which have the denoised layers. Both are 0 if no crop has light.
DenoisedPilot DenoisedErrors(std::span<const FrameImage> crops);

// The image error (relMSE) at which the denoised layer reaches `target`. low: without any gain;
// high: with the pilot's gain.
coordinator::Estimate ImageErrorFor(double target, const DenoisedPilot& pilot);

}  // namespace sheaf::cli
