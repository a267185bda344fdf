// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Reads and writes whole images: PNG files for people to view, and input images of scenes
// (environment maps, textures that are checked before rendering). Rendered images are EXR and have
// their own codec (common/film/exr/exr_codec.h). Only image_library.h gives access to OpenImageIO.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/image/image_limits.h"

namespace sheaf {

// One display-referred pixel: sRGB-encoded, 8 bits per channel.
struct Rgb8 {
  uint8_t r = 0, g = 0, b = 0;
  friend constexpr bool operator==(const Rgb8&, const Rgb8&) = default;
};

// The bytes of a PNG file. pixels is row-major [height][width], top row first.
// Requires: width, height > 0; pixels.size() == width * height.
// Errors: kInternal if the encoder fails.
absl::StatusOr<std::string> EncodePng(int width, int height, const std::vector<Rgb8>& pixels);
// The same, written to path durably and atomically. Errors: also those of WriteFileAtomically.
absl::Status WritePng(const std::string& path, int width, int height,
                      const std::vector<Rgb8>& pixels);

// An image file as linear values: gray, or red, green and blue, by the names of its channels. Its
// alpha is ignored, and colors are not multiplied by it. Integers are decoded as sRGB; floats are
// taken unchanged, including NaN and infinity.
struct FloatImage {
  int width = 0, height = 0;  // In EXR of the display window; what is not stored of it is black.
  int channels = 0;           // 1 or 3.
  std::vector<float> pixels;  // Row-major [height][width][channels], top row first.
  // Chromaticities of red, green, blue and white, x before y, if the file gives them (EXR). The
  // values are in these primaries.
  std::optional<std::array<float, 8>> chromaticities;

  // Requires: 0 <= x < width, 0 <= y < height, 0 <= channel < channels.
  float At(int x, int y, int channel) const { return pixels[IndexOf(x, y, channel)]; }
  float& At(int x, int y, int channel) { return pixels[IndexOf(x, y, channel)]; }

 private:
  size_t IndexOf(int x, int y, int channel) const {
    return (static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)) *
               static_cast<size_t>(channels) +
           static_cast<size_t>(channel);
  }
};

struct ReadImageLimits {
  uint64_t memory_bytes_max = uint64_t{4} << 30;  // For the numbers that are read, as floats.
  int64_t side_max = kImageSideMax;               // Columns, and rows.
  // If the image or what is stored of it has more pixels, only the header is read, and
  // FloatImage::pixels stays empty.
  uint64_t whole_pixels_max = std::numeric_limits<uint64_t>::max();
};

// Reads EXR, PFM, HDR, PNG, TGA, JPEG, TIFF and the other formats of OpenImageIO. Textures read
// files by the same rules (texture_cache.h).
// Errors: kNotFound; kInvalidArgument for a file that is not an image, truncated or damaged, whose
// channels have no meaning (openimageio/image_layout.h), or beyond the limits of its header
// (image_limits.h); kResourceExhausted beyond memory_bytes_max. Messages begin with the path.
absl::StatusOr<FloatImage> ReadImage(const std::string& path, const ReadImageLimits& limits = {});
// The error of ReadImage, without its numbers as floats.
absl::Status CheckImage(const std::string& path, const ReadImageLimits& limits = {});

// Opto-electronic transfer of sRGB and its inverse, on [0, 1]; values outside are clamped, NaN
// gives 0. Source: IEC 61966-2-1. Same bits on every machine (common/math/elementary.h).
float EncodeSrgb(float linear);
float DecodeSrgb(float encoded);
// EncodeSrgb, rounded to the nearest of 256 levels.
uint8_t EncodeSrgb8(float linear);

}  // namespace sheaf
