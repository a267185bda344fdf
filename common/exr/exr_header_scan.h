// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Scans the header of untrusted EXR bytes before any library allocates the sizes it declares: the
// scan stays within the given bytes, and returns the fields that determine memory. Layout: "OpenEXR
// File Layout", openexr.com (magic, version, attributes as name, type, size, value).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace sheaf {

struct ExrChannel {
  enum class Type : int32_t { kUint = 0, kHalf = 1, kFloat = 2 };
  std::string name;
  Type type = Type::kFloat;
  bool subsampled = false;
};

// Half-open: [x0, x1) x [y0, y1) in pixels, y down.
struct ExrWindow {
  int32_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  friend constexpr bool operator==(const ExrWindow&, const ExrWindow&) = default;
};

// One part's header.
struct ExrHeader {
  ExrWindow data_window, display_window;
  std::vector<ExrChannel> channels;  // In the file's order.
  uint8_t compression = 0;           // As numbered by the file format.
  uint8_t line_order = 0;            // 0: increasing y.
  int64_t tile_pixels = 0;           // Pixels per tile; 0 in a scan-line part.
  // "chromaticities": x and y of red, green, blue and white; empty if the file has none.
  std::optional<std::array<float, 8>> chromaticities;
  std::map<std::string, std::string> types;    // Attribute name to its type's name.
  std::map<std::string, std::string> strings;  // The attributes of type string.
  // The values as they lie in the file of the attributes of these types: int, float, rational, v2i,
  // box2i, m44f; each of its type's size.
  std::map<std::string, std::string> numbers;
};

struct ExrFileHeader {
  bool deep = false;             // Holds lists of samples instead of pixels.
  std::vector<ExrHeader> parts;  // At least one.
};

// Errors: kInvalidArgument (not an EXR, contradictory or duplicate attributes), kDataLoss (ends
// within the header). Cost: memory proportional to the header's own bytes.
absl::StatusOr<ExrFileHeader> ScanExrHeader(std::string_view bytes);

// Scans the header of the file at path; none if the file has another format.
// Errors: kInvalidArgument, also where the header is larger than kExrHeaderBytesMax; the message
// begins with the path. Cost: reads the header, at most 16 times its size.
absl::StatusOr<std::optional<ExrFileHeader>> ReadExrHeader(const std::string& path);
inline constexpr size_t kExrHeaderBytesMax = size_t{1} << 26;

}  // namespace sheaf
