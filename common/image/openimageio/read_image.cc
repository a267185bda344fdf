// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/openimageio/read_image.h"

#include <array>
#include <cstdint>
#include <exception>
#include <memory>
#include <new>

#include <OpenImageIO/imageio.h>

#include "absl/strings/str_cat.h"

namespace sheaf {
namespace {

absl::Status CheckSize(const std::string& path, const OIIO::ImageSpec& spec,
                       const ReadImageLimits& limits) {
  if (spec.width <= 0 || spec.height <= 0 || spec.nchannels <= 0 || spec.depth > 1) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": not a flat image (", spec.width, " x ",
                                                   spec.height, " x ", spec.depth, ", ",
                                                   spec.nchannels, " channels)"));
  }
  const uint64_t width = static_cast<uint64_t>(spec.width);
  const uint64_t height = static_cast<uint64_t>(spec.height);
  // Sizes are below 2^31 each, so the quotient form cannot overflow.
  const uint64_t row_bytes = width * static_cast<uint64_t>(spec.nchannels) * sizeof(float);
  if (spec.nchannels > limits.channels_max || height > limits.memory_bytes_max / row_bytes) {
    return absl::ResourceExhaustedError(
        absl::StrCat(path, ": ", spec.width, " x ", spec.height, " pixels of ", spec.nchannels,
                     " channels are more than the limit of ", limits.memory_bytes_max,
                     " bytes and ", limits.channels_max, " channels; use a smaller image"));
  }
  return absl::OkStatus();
}

absl::StatusOr<FloatImage> ReadOpened(const std::string& path, OIIO::ImageInput& input,
                                      const ReadImageLimits& limits) {
  const OIIO::ImageSpec& spec = input.spec();
  if (absl::Status size = CheckSize(path, spec, limits); !size.ok()) return size;
  FloatImage image;
  image.width = spec.width;
  image.height = spec.height;
  image.channels = spec.nchannels;
  image.is_8bit = spec.format == OIIO::TypeDesc::UINT8;
  image.is_integer = !spec.format.is_floating_point();
  std::array<float, 8> xy{};
  if (spec.getattribute("chromaticities", OIIO::TypeDesc(OIIO::TypeDesc::FLOAT, 8), xy.data())) {
    image.chromaticities = xy;
  }
  if (static_cast<uint64_t>(spec.width) * static_cast<uint64_t>(spec.height) >
      limits.whole_pixels_max) {
    return image;
  }
  image.pixels.resize(static_cast<size_t>(spec.width) * static_cast<size_t>(spec.height) *
                      static_cast<size_t>(spec.nchannels));
  if (!input.read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::FLOAT, image.pixels.data())) {
    return absl::InvalidArgumentError(absl::StrCat(
        path,
        ": cannot be decoded: ", OneLine(input.geterror(), "the file is cut short or damaged")));
  }
  return image;
}

}  // namespace

std::string OneLine(std::string text, const std::string& fallback) {
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  for (char& c : text) {
    if (c == '\n') c = ' ';
  }
  return text.empty() ? fallback : text;
}

absl::StatusOr<FloatImage> ReadByOpenImageIO(const std::string& path,
                                             const ReadImageLimits& limits) {
  try {
    OIIO::ImageSpec requested_spec;
    requested_spec.attribute("oiio:UnassociatedAlpha", 1);
    std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::open(path, &requested_spec);
    if (!input) {
      return absl::InvalidArgumentError(absl::StrCat(
          path, ": not a readable image: ", OneLine(OIIO::geterror(), "unknown format")));
    }
    return ReadOpened(path, *input, limits);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError(
        absl::StrCat(path, ": there is no memory to decode the image"));
  } catch (const std::exception& error) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": cannot be decoded: ", error.what()));
  }
}

}  // namespace sheaf
