// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The layers of a developed image for display: the image, its light with the full dynamic range,
// and in false color the error, the samples and the CPU time of each pixel. All layers are shrunk
// by the same integer factor if the image is larger than a screen needs.
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
  // Linear sRGB with a common exponent, for viewers that choose the exposure. The upper half of the
  // image holds mantissas, the lower half exponents: with e the level at the same place in the
  // lower half, which is equal in all channels, a component is level * 2^(e - 136), or 0 if e is 0.
  // Source: Ward 1991, "Real Pixels", Graphics Gems II (the RGBE format), without its half level.
  kLight,
  // Relative standard error, on a logarithmic scale: the root of the mean, over R, G, B and the
  // pixels of the displayed square, of stderr^2 / (value^2 + (0.1 m)^2), with m the mean of the
  // image. The mean square of this layer is the relative mean squared error of the frame
  // (common/film/error/error_estimate.h).
  kError,
  // Samples per pixel, on a linear scale.
  kSamples,
  // CPU time per pixel in seconds, averaged over the tile, on a logarithmic scale.
  kTime,
};

// From "image", "light", "error", "samples" or "time"; "" means "image".
std::optional<ImageLayer> ImageLayerFromName(const std::string& name);

// The channels of FrameImage that a layer is computed from.
std::vector<std::string> ChannelsOf(ImageLayer layer);

// The values at the ends of the false colors; both are 0 if none are known yet.
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

// The gray of unknown values in false color, for example of pixels without enough samples.
inline constexpr Rgb8 kUnknownColor{96, 96, 96};

// A range that a viewer chose for false colors; none: that of the values. On logarithmic scales a
// range that begins at 0 or below begins at kRangeStartFraction of its end.
using ChosenRange = std::optional<LayerRange>;
inline constexpr double kRangeStartFraction = 1e-6;

// The place of a value on a logarithmic scale: 0 at the low end, 1 at the high end. Values of 0 or
// less are at the low end. Requires: range.high > 0.
double LogarithmicPlace(const LayerRange& range, double value);

// full_size: not shrunk. range: of layers in false color. Errors: kInternal if the image lacks a
// channel of ChannelsOf(layer).
absl::StatusOr<DisplayImage> MakeDisplayImage(const FrameImage& image, ImageLayer layer,
                                              bool full_size = false,
                                              const ChosenRange& range = std::nullopt);

}  // namespace sheaf::coordinator
