// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/image_io.h"

#include <filesystem>
#include <memory>
#include <system_error>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/base/file.h"
#include "common/image/png_tags.h"
#include "common/math/elementary.h"

namespace sheaf {
namespace {

// OpenImageIO's messages come with line ends and sometimes not at all.
std::string OneLine(std::string text, const std::string& fallback) {
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  for (char& c : text) {
    if (c == '\n') c = ' ';
  }
  return text.empty() ? fallback : text;
}

absl::Status CheckSize(const std::string& path, const OIIO::ImageSpec& spec,
                       const ReadImageLimits& limits) {
  if (spec.width <= 0 || spec.height <= 0 || spec.nchannels <= 0 || spec.depth > 1) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": not a flat picture (", spec.width,
                                                   " x ", spec.height, " x ", spec.depth, ", ",
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
                     " bytes and ", limits.channels_max, " channels; use a smaller picture"));
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

absl::StatusOr<std::string> EncodePng(int width, int height, const std::vector<Rgb8>& pixels) {
  return EncodeTaggedPng(width, height, pixels, {});
}

absl::StatusOr<std::string> EncodeTaggedPng(int width, int height, const std::vector<Rgb8>& pixels,
                                            const PngTags& tags) {
  SHEAF_CHECK(width > 0 && height > 0);
  SHEAF_CHECK(pixels.size() == static_cast<size_t>(width) * static_cast<size_t>(height));
  static_assert(sizeof(Rgb8) == 3, "pixels are handed over as packed bytes");
  try {
    std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create("picture.png");
    if (!output) return absl::InternalError("OpenImageIO of this machine has no PNG writer");
    OIIO::ImageSpec spec(width, height, 3, OIIO::TypeDesc::UINT8);
    if (tags.is_srgb) spec.attribute("oiio:ColorSpace", "sRGB");
    for (const auto& [keyword, text] : tags.text) spec.attribute(keyword, text);
    std::vector<unsigned char> bytes;
    OIIO::Filesystem::IOVecOutput sink(bytes);
    const bool written = output->set_ioproxy(&sink) && output->open("picture.png", spec) &&
                         output->write_image(OIIO::TypeDesc::UINT8, pixels.data()) &&
                         output->close();
    if (!written) {
      return absl::InternalError(
          absl::StrCat("PNG encoding failed: ", OneLine(output->geterror(), "no reason given")));
    }
    return std::string(bytes.begin(), bytes.end());
  } catch (const std::exception& error) {
    return absl::InternalError(absl::StrCat("PNG encoding failed: ", error.what()));
  }
}

absl::Status WritePng(const std::string& path, int width, int height,
                      const std::vector<Rgb8>& pixels) {
  const absl::StatusOr<std::string> bytes = EncodePng(width, height, pixels);
  if (!bytes.ok()) return bytes.status();
  return WriteFileAtomically(path, *bytes);
}

absl::StatusOr<FloatImage> ReadImage(const std::string& path, const ReadImageLimits& limits) {
  std::error_code code;
  if (!std::filesystem::is_regular_file(path, code)) {
    return absl::NotFoundError(absl::StrCat(path, ": no such file"));
  }
  try {
    OIIO::ImageSpec wishes;
    wishes.attribute("oiio:UnassociatedAlpha", 1);
    std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::open(path, &wishes);
    if (!input) {
      return absl::InvalidArgumentError(absl::StrCat(
          path, ": not a picture that can be read: ", OneLine(OIIO::geterror(), "unknown format")));
    }
    return ReadOpened(path, *input, limits);
  } catch (const std::exception& error) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": cannot be decoded: ", error.what()));
  }
}

float EncodeSrgb(float linear) {
  if (!(linear > 0)) return 0;
  if (linear >= 1) return 1;
  if (linear <= 0.0031308f) return 12.92f * linear;
  return 1.055f * Pow(linear, 1 / 2.4f) - 0.055f;
}

float DecodeSrgb(float encoded) {
  if (!(encoded > 0)) return 0;
  if (encoded >= 1) return 1;
  if (encoded <= 0.04045f) return encoded / 12.92f;
  return Pow((encoded + 0.055f) / 1.055f, 2.4f);
}

uint8_t EncodeSrgb8(float linear) { return static_cast<uint8_t>(EncodeSrgb(linear) * 255 + 0.5f); }

}  // namespace sheaf
