// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Whole pictures in and out: what people look at (PNG) and what scenes bring along (environment
// maps, textures that are checked before rendering). Rendered pictures are EXR and have a door of
// their own (common/film/exr/exr_codec.h). image_library.h is the door to OpenImageIO,
// png.cc that to libpng.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace sheaf {

// One display-referred pixel: sRGB-encoded, 8 bits a channel.
struct Rgb8 {
  uint8_t r = 0, g = 0, b = 0;
  friend constexpr bool operator==(const Rgb8&, const Rgb8&) = default;
};

// The bytes of a PNG file.
// Shape: pixels is row-major [height][width], top row first.
// Requires: width, height > 0; pixels.size() == width * height.
// Errors: kInternal where the encoder fails.
absl::StatusOr<std::string> EncodePng(int width, int height, const std::vector<Rgb8>& pixels);
// The same, written to path durably and atomically. Errors: also those of WriteFileAtomically.
absl::Status WritePng(const std::string& path, int width, int height,
                      const std::vector<Rgb8>& pixels);

// A picture as its file stores it: integer formats become value / largest value and stay encoded
// (usually sRGB); float formats are taken as they are, NaN and infinity included.
struct FloatImage {
  int width = 0, height = 0, channels = 0;
  std::vector<float> pixels;  // Row-major [height][width][channels], top row first.
  bool is_8bit = false;       // The file holds 8-bit integers.
  bool is_integer = false;    // The file holds integers of any width.
  // Of red, green, blue and white, x before y, where the file says (EXR).
  std::optional<std::array<float, 8>> chromaticities;

  // Requires: 0 <= x < width, 0 <= y < height, 0 <= channel < channels.
  float At(int x, int y, int channel) const {
    return pixels[(static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)) *
                      static_cast<size_t>(channels) +
                  static_cast<size_t>(channel)];
  }
};

struct ReadImageLimits {
  uint64_t memory_bytes_max = uint64_t{4} << 30;  // Of FloatImage::pixels.
  int channels_max = 64;
  // Beyond so many pixels the header alone is read, and FloatImage::pixels stays empty.
  uint64_t whole_pixels_max = std::numeric_limits<uint64_t>::max();
};

// Reads EXR, PFM, HDR, PNG, TGA, JPEG, TIFF and what else OpenImageIO knows. Colour channels are
// not multiplied by alpha. Errors: kNotFound; kInvalidArgument for a file that is no picture, is
// cut short or damaged; kResourceExhausted beyond the limits. Messages begin with the path.
absl::StatusOr<FloatImage> ReadImage(const std::string& path, const ReadImageLimits& limits = {});

// Opto-electronic transfer of sRGB and its inverse, on [0, 1]; values outside are clamped, NaN
// gives 0. Source: IEC 61966-2-1. Same bits on every machine (common/math/elementary.h).
float EncodeSrgb(float linear);
float DecodeSrgb(float encoded);
// EncodeSrgb, rounded to the nearest of 256 levels.
uint8_t EncodeSrgb8(float linear);

}  // namespace sheaf
