// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ExrFormat: how an image's EXR stores its pixels. The default loses nothing and is what the
// coordinator delivers; other formats are for copies that go to other programs.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "common/film/frame_image.h"

namespace sheaf {

// kHalf: colors (R, G, B, A) as 16-bit floats; data (depth, positions, normals, ids and coverages,
// errors, counts) stay 32-bit floats.
enum class ExrType : uint8_t { kFloat, kHalf };
// Those of the file format. kDwaa and kDwab lose precision of colors, the others nothing.
enum class ExrCompression : uint8_t { kUncompressed, kZip, kZips, kPiz, kDwaa, kDwab };
// kMulti: a part for each layer.
enum class ExrParts : uint8_t { kSingle, kMulti };

// Edge of a tile, in pixels.
inline constexpr int32_t kExrTileSizePxMin = 8, kExrTileSizePxMax = 4096;

struct ExrFormat {
  ExrType type = ExrType::kFloat;
  ExrCompression compression = ExrCompression::kZip;
  // Otherwise several where the compression needs them: kDwaa and kDwab would also take the R, G
  // and B of mattes and errors for colors, so data have parts of their own with kZip.
  std::optional<ExrParts> parts = std::nullopt;
  int32_t tile_size_px = 0;  // 0: scan lines.

  bool IsDwa() const {
    return compression == ExrCompression::kDwaa || compression == ExrCompression::kDwab;
  }
  bool HasSeveralParts() const { return parts ? *parts == ExrParts::kMulti : IsDwa(); }
  friend bool operator==(const ExrFormat&, const ExrFormat&) = default;
};

// "float", "half"; "none", "zip" ...; "single", "multi".
const char* ExrTypeName(ExrType type);
const char* ExrCompressionName(ExrCompression compression);
const char* ExrPartsName(ExrParts parts);

// What the format does to the pixels: "half", "dwaa", "half, dwaa"; empty if they keep their bits.
// A file states it in its attribute "sheaf:rounding" (kRoundingKey).
std::string RoundingOf(const ExrFormat& format);

// Errors: kInvalidArgument for kSingle with kDwaa or kDwab, and for tiles out of range.
absl::Status CheckExrFormat(const ExrFormat& format);

// The number of color values beyond the range of 16-bit floats, which kHalf cuts at 65504.
int64_t CountBeyondHalf(const FrameImage& image);

// The image in that format, with the metadata kRoundingKey if it loses bits. The default gives the
// bytes of EncodeFrameImage(image). Requires: CheckExrFormat is OK.
std::string EncodeFrameImage(const FrameImage& image, const ExrFormat& format);

}  // namespace sheaf
