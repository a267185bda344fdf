// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ReadPlainImage: images of the usual formats, in their usual forms, without OpenImageIO, which
// takes half a second and 100 MB to load (image_library.h). Their values have the same bits by
// either way. A file that these readers do not take (another format, a rare form of one, damage) is
// not an error: OpenImageIO reads it, or says why it cannot.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace sheaf {

// The numbers of an image as its file stores them.
struct PlainImage {
  enum class Type : uint8_t { kUint8, kUint16, kHalf, kFloat };
  int width = 0, height = 0;
  int channels = 0;  // 1: gray, 3: red, green and blue, 4: the same and alpha.
  Type type = Type::kUint8;
  std::vector<std::byte> numbers;  // Row-major [height][width][channels], top row first; native.
  // As FloatImage::chromaticities.
  std::optional<std::array<float, 8>> chromaticities;

  bool IsInteger() const { return type == Type::kUint8 || type == Type::kUint16; }
  size_t NumberBytes() const {
    return type == Type::kUint8 ? 1 : type == Type::kFloat ? sizeof(float) : sizeof(uint16_t);
  }
  size_t NumberCount() const { return numbers.size() / NumberBytes(); }
};

// numbers[at] as a float; integers are those of [0, 1].
float NumberAt(const PlainImage& image, size_t at);
// The same for a half or 16 bits of one.
float FloatOfHalf(uint16_t bits);

struct PlainRequest {
  uint64_t bytes_max = uint64_t{1} << 40;  // The numbers take at most this.
  bool is_header_enough = false;           // Then `numbers` stays empty.
};

// Reads PNG, JPEG, PFM, TGA and EXR. None for what these readers do not take, and for larger
// images. Requires: CheckImageHeader(path) is OK.
std::optional<PlainImage> ReadPlainImage(const std::string& path, const PlainRequest& request = {});

}  // namespace sheaf
