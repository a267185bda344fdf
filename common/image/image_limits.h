// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Limits of what the header of an image may claim. They are checked before memory is taken for it,
// in every format alike.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"

namespace sheaf {

inline constexpr int64_t kImageSideMax = int64_t{1} << 17;  // Columns, and rows.
inline constexpr int64_t kImagePixelsMax = int64_t{1} << 32;
inline constexpr int64_t kImageChannelsMax = 1024;
// Readers hold some dozens of rows, and a few tiles per thread.
inline constexpr int64_t kImageRowValuesMax = int64_t{1} << 20;
inline constexpr int64_t kImageTileValuesMax = int64_t{1} << 24;
// Limits formats that a library decodes as a whole; the others are read in bands of rows.
inline constexpr int64_t kWholeImageValuesMax = int64_t{1} << 30;
// Columns and rows of an image of a light: it stays in memory, at 12 to 18 bytes a pixel.
inline constexpr int64_t kLightImageSideMax = 8192;

// The sizes that a header states. Numbers below 1 count as too large.
struct ImageClaim {
  int64_t width = 1, height = 1, channels = 1;
  int64_t tile_pixels = 1;  // 1: no tiles.
  bool is_read_whole = false;
};

// side_max: kImageSideMax or less. Errors: kInvalidArgument; the message begins with the path.
absl::Status CheckImageClaim(const std::string& path, const ImageClaim& claim,
                             int64_t side_max = kImageSideMax);

}  // namespace sheaf
