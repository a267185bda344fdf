// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/image_io.h"

#include <algorithm>
#include <utility>

#include "common/base/file.h"
#include "common/base/load_phases.h"
#include "common/image/image_header.h"
#include "common/image/image_library.h"
#include "common/image/plain_image.h"

namespace sheaf {

absl::Status WritePng(const std::string& path, int width, int height,
                      const std::vector<Rgb8>& pixels) {
  const absl::StatusOr<std::string> bytes = EncodePng(width, height, pixels);
  if (!bytes.ok()) return bytes.status();
  return WriteFileAtomically(path, *bytes);
}

namespace {

FloatImage FloatsOf(const PlainImage& plain) {
  FloatImage image;
  image.width = plain.width;
  image.height = plain.height;
  image.channels = std::min(plain.channels, 3);
  image.chromaticities = plain.chromaticities;
  const auto stored = static_cast<size_t>(plain.channels);
  const auto channels = static_cast<size_t>(image.channels);
  image.pixels.reserve(plain.NumberCount() / stored * channels);
  for (size_t at = 0; at < plain.NumberCount(); at += stored) {
    for (size_t c = 0; c < channels; ++c) {
      const float value = NumberAt(plain, at + c);
      image.pixels.push_back(plain.IsInteger() ? DecodeSrgb(value) : value);
    }
  }
  return image;
}

// None where OpenImageIO must read the image, or say why it cannot be read within the limits.
std::optional<PlainImage> ReadWithoutLibrary(const std::string& path,
                                             const ReadImageLimits& limits) {
  std::optional<PlainImage> header = ReadPlainImage(path, {.is_header_enough = true});
  if (!header || std::max(header->width, header->height) > limits.side_max) return std::nullopt;
  const uint64_t pixels = static_cast<uint64_t>(header->width) * header->height;
  if (pixels > limits.whole_pixels_max) return header;
  if (pixels * header->channels * sizeof(float) > limits.memory_bytes_max) return std::nullopt;
  return ReadPlainImage(path);
}

absl::StatusOr<FloatImage> ReadByLibrary(const std::string& path, const ReadImageLimits& limits) {
  const absl::StatusOr<const ImageLibrary*> library = LoadImageLibrary();
  if (!library.ok()) return library.status();
  return (*library)->read(path, limits);
}

}  // namespace

absl::StatusOr<FloatImage> ReadImage(const std::string& path, const ReadImageLimits& limits) {
  const PhaseTimer timer(LoadPhase::kImages);
  if (absl::Status header = CheckImageHeader(path); !header.ok()) return header;
  if (const auto plain = ReadWithoutLibrary(path, limits)) return FloatsOf(*plain);
  return ReadByLibrary(path, limits);
}

absl::Status CheckImage(const std::string& path, const ReadImageLimits& limits) {
  if (absl::Status header = CheckImageHeader(path); !header.ok()) return header;
  if (ReadWithoutLibrary(path, limits)) return absl::OkStatus();
  return ReadByLibrary(path, limits).status();
}

}  // namespace sheaf
