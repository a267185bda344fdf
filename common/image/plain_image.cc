// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/plain_image.h"

#include <algorithm>
#include <cstring>
#include <fstream>
#include <utility>

#include "common/base/file.h"
#include "common/base/large_pages.h"
#include "common/image/image_limits.h"
#include "common/image/plain_formats.h"

namespace sheaf {
namespace {

// A file of one of these formats is at most about as long as its numbers.
constexpr uint64_t kHeaderBytesMax = uint64_t{1} << 20;
// Headers and what stands before the numbers are rarely longer.
constexpr size_t kBeginningBytes = size_t{1} << 18;

std::optional<std::string> BytesOf(const std::string& path, const PlainRequest& request) {
  if (!request.is_header_enough) {
    absl::StatusOr<std::string> bytes = ReadWholeFile(path, request.bytes_max + kHeaderBytesMax);
    return bytes.ok() ? std::optional(*std::move(bytes)) : std::nullopt;
  }
  std::string bytes(kBeginningBytes, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<size_t>(file.gcount()));
  return bytes;
}

template <typename Number>
Number Load(const PlainImage& image, size_t at) {
  Number number;
  std::memcpy(&number, &image.numbers[at * sizeof(Number)], sizeof(Number));
  return number;
}

}  // namespace

float NumberAt(const PlainImage& image, size_t at) {
  switch (image.type) {
    case PlainImage::Type::kUint8:
      return static_cast<float>(Load<uint8_t>(image, at)) * (1.0f / 255);
    case PlainImage::Type::kUint16:
      return static_cast<float>(Load<uint16_t>(image, at)) * (1.0f / 65535);
    case PlainImage::Type::kHalf:
      return FloatOfHalf(Load<uint16_t>(image, at));
    case PlainImage::Type::kFloat:
      break;
  }
  return Load<float>(image, at);
}

std::optional<PlainImage> MakePlainImage(int64_t width, int64_t height, int channels,
                                         PlainImage::Type type, const PlainRequest& request) {
  if (!CheckImageClaim("", {.width = width, .height = height, .channels = channels}).ok()) {
    return std::nullopt;
  }
  PlainImage image;
  image.width = static_cast<int>(width);
  image.height = static_cast<int>(height);
  image.channels = channels;
  image.type = type;
  const uint64_t bytes = static_cast<uint64_t>(width * height * channels) * image.NumberBytes();
  if (bytes > request.bytes_max) return std::nullopt;
  if (!request.is_header_enough) {
    image.numbers.reserve(bytes);
    AdviseHugePages(image.numbers.data(), bytes);
    image.numbers.resize(bytes);
  }
  return image;
}

std::optional<PlainImage> ReadPlainImage(const std::string& path, const PlainRequest& request) {
  if (std::optional<PlainImage> exr = ReadExr(path, request)) return exr;
  // A file is read as a whole only if its beginning is that of such an image.
  if (!request.is_header_enough &&
      !ReadPlainImage(path, {.bytes_max = request.bytes_max, .is_header_enough = true})) {
    return std::nullopt;
  }
  const std::optional<std::string> bytes = BytesOf(path, request);
  if (!bytes) return std::nullopt;
  for (const auto read : {ReadPng, ReadJpeg, ReadPfm, ReadTga}) {
    if (std::optional<PlainImage> image = read(*bytes, request)) return image;
  }
  return std::nullopt;
}

}  // namespace sheaf
