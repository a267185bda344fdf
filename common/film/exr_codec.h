// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The only door to OpenEXR: film parts and developed pictures to bytes and back, without loss.
#pragma once

#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "common/film/film.h"
#include "common/film/film_tile.h"

namespace sheaf {

// Identity of a part; travels in the EXR header and is checked on decoding.
struct PartHeader {
  std::string frame_digest;  // Hex SHA-256: scene, settings, frame, numeric profile.
  std::string numeric_profile;
};

// A part as a float32 EXR that any viewer opens. Equal parts give equal bytes.
std::string EncodePart(const FilmTile& tile, const PartHeader& header);
struct DecodedPart {
  FilmTile tile;
  PartHeader header;
};
// The bytes are untrusted: sizes are checked against part_pixels_max before memory is taken.
// Errors: kInvalidArgument (not a part, wrong channels, absurd size), kDataLoss (truncated).
absl::StatusOr<DecodedPart> DecodePart(std::string_view bytes, int64_t part_pixels_max = 1 << 22);

// Writes atomically (temporary file, fsync, rename). Errors carry the path and the reason.
absl::Status WritePicture(const FramePicture& picture, const std::string& path);
std::string EncodePicture(const FramePicture& picture);
// Reads any flat EXR's float/half channels (R, G, B at least); used by compare.
absl::StatusOr<FramePicture> ReadPicture(const std::string& path);

}  // namespace sheaf
