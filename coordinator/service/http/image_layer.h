// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The layers of a developed image that a screen can show: the image itself, its light with all
// its range, and in false color the error and the samples of each pixel. Every layer is shrunk by
// the same whole factor where the image is larger than any screen needs.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/film.h"
#include "common/image/image_io.h"

namespace sheaf::coordinator {

enum class ImageLayer {
  // sRGB curve, clamped to [0, 1].
  kImage,
  // Linear sRGB with a common exponent, for viewers that choose the exposure. The upper half holds
  // the mantissas: with e the level in the lower half at the same place, which is the same in all
  // three channels, a component is level * 2^(e - 136), and 0 where e is 0.
  // Source: Ward 1991, "Real Pixels", Graphics Gems II (the RGBE format), without its half level.
  kLight,
  // Relative standard error, on a logarithmic scale: the root of the mean, over R, G, B and the
  // pixels of the square that is shown, of stderr^2 / (value^2 + (0.1 m)^2), m the image's mean.
  // The mean square of this layer is the relative mean squared error of the frame
  // (common/film/error/error_estimate.h).
  kError,
  // Samples of a pixel, on a linear scale.
  kSamples,
  // CPU time that a pixel took, seconds, the mean over its tile, on a logarithmic scale.
  kTime,
};

// By the names "image", "light", "error", "samples" and "time"; "" means the image.
std::optional<ImageLayer> ImageLayerFromName(const std::string& name);

// The channels of FrameImage that a layer is made from.
std::vector<std::string> ChannelsOf(ImageLayer layer);

// The values at the ends of the false colors, both 0 where none are known yet.
struct LayerRange {
  double low = 0, high = 0;
  friend bool operator==(const LayerRange&, const LayerRange&) = default;
};

// Shape: row-major [height_px][width_px].
struct DisplayImage {
  int32_t width_px = 0;
  int32_t height_px = 0;
  std::vector<Rgb8> pixels;
  std::optional<LayerRange> range;  // Only for layers in false color.
};

// False colors show what cannot be told, for example for want of samples, in this gray.
inline constexpr Rgb8 kUnknownColor{96, 96, 96};

// Errors: kInternal where the image lacks a channel of ChannelsOf(layer).
absl::StatusOr<DisplayImage> MakeDisplayImage(const FrameImage& image, ImageLayer layer);

}  // namespace sheaf::coordinator
