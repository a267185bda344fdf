// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ImageLayout: where the colors of an image lie in its file. Surfaces and lights read images by it,
// so that a file means the same to both.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include <OpenImageIO/imageio.h>

#include "absl/status/statusor.h"

namespace sheaf {

struct ImageLayout {
  // The size of the image: in EXR the display window, in all other formats what is stored.
  int width = 0, height = 0;
  // The pixels that are stored, half-open; those around them are black and transparent.
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  int origin_x = 0, origin_y = 0;  // The file's coordinates of the image's first pixel.
  int channels = 0;                // 1: gray, 3: red, green and blue, 4: the same and alpha.
  std::array<int, 4> place{};      // The place of each in a stored pixel.
  bool is_integer = false;
  std::optional<std::array<float, 8>> chromaticities;  // As in FloatImage.

  bool Stores(int x, int y) const { return x >= x0 && x < x1 && y >= y0 && y < y1; }
  bool StoresAll() const { return x0 == 0 && y0 == 0 && x1 == width && y1 == height; }
};

// Takes the channels of an EXR by name (channel_names.h). Other formats have no names: two channels
// are gray and alpha, and those beyond the fourth are ignored.
// format: the library's name of it. Errors: kInvalidArgument for sizes beyond the limits
// (image_limits.h), an image that is not flat, and channels without a meaning. Messages begin with
// the path.
absl::StatusOr<ImageLayout> LayoutOf(const std::string& path, std::string_view format,
                                     const OIIO::ImageSpec& spec, int64_t side_max);

}  // namespace sheaf
