// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/openimageio/read_image.h"

#include <algorithm>
#include <cstdint>
#include <exception>
#include <memory>
#include <new>
#include <string>
#include <utility>
#include <vector>

#include <OpenImageIO/imageio.h>

#include "absl/strings/str_cat.h"
#include "common/image/openimageio/image_layout.h"

namespace sheaf {
namespace {

absl::Status CheckMemory(const std::string& path, const ImageLayout& layout,
                         const OIIO::ImageSpec& spec, const ReadImageLimits& limits) {
  const auto bytes = [](int64_t width, int64_t height, int64_t channels) {
    return static_cast<uint64_t>(width * height * channels) * sizeof(float);
  };
  // The limits of the layout keep these products within 64 bits.
  const uint64_t needed = std::max(bytes(layout.width, layout.height, layout.channels),
                                   bytes(spec.width, spec.height, spec.nchannels));
  if (needed <= limits.memory_bytes_max) return absl::OkStatus();
  return absl::ResourceExhaustedError(
      absl::StrCat(path, ": needs ", needed, " bytes of memory, but ", limits.memory_bytes_max,
                   " are the most for an image that is read as a whole; make it smaller"));
}

// The stored numbers of all pixels, from channel `begin` to before `end`.
absl::Status ReadStored(const std::string& path, OIIO::ImageInput& input, int begin, int end,
                        std::vector<float>* values) {
  const OIIO::ImageSpec& spec = input.spec();
  values->resize(static_cast<size_t>(spec.width) * static_cast<size_t>(spec.height) *
                 static_cast<size_t>(end - begin));
  if (input.read_image(0, 0, begin, end, OIIO::TypeDesc::FLOAT, values->data())) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat(
      path,
      ": cannot be decoded: ", OneLine(input.geterror(), "the file is cut short or damaged")));
}

absl::Status ReadPixels(const std::string& path, OIIO::ImageInput& input, const ImageLayout& layout,
                        FloatImage* image) {
  const auto [first, last] =
      std::minmax_element(layout.place.begin(), layout.place.begin() + image->channels);
  const int begin = *first, end = *last + 1;
  // The stored pixels may extend beyond the image.
  const bool is_as_stored =
      input.spec().width == image->width && input.spec().height == image->height &&
      layout.StoresAll() && end - begin == image->channels &&
      std::is_sorted(layout.place.begin(), layout.place.begin() + image->channels);
  if (is_as_stored) return ReadStored(path, input, begin, end, &image->pixels);
  std::vector<float> stored;
  if (absl::Status status = ReadStored(path, input, begin, end, &stored); !status.ok()) {
    return status;
  }
  const OIIO::ImageSpec& spec = input.spec();
  image->pixels.resize(static_cast<size_t>(image->width) * static_cast<size_t>(image->height) *
                       static_cast<size_t>(image->channels));
  for (int y = layout.y0; y < layout.y1; ++y) {
    for (int x = layout.x0; x < layout.x1; ++x) {
      const auto row = static_cast<size_t>(y + layout.origin_y - spec.y);
      const auto column = static_cast<size_t>(x + layout.origin_x - spec.x);
      const size_t from =
          (row * static_cast<size_t>(spec.width) + column) * static_cast<size_t>(end - begin);
      for (int c = 0; c < image->channels; ++c) {
        const int place = layout.place[static_cast<size_t>(c)] - begin;
        image->At(x, y, c) = stored[from + static_cast<size_t>(place)];
      }
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<FloatImage> ReadOpened(const std::string& path, OIIO::ImageInput& input,
                                      const ReadImageLimits& limits) {
  const absl::StatusOr<ImageLayout> layout =
      LayoutOf(path, input.format_name(), input.spec(), limits.side_max);
  if (!layout.ok()) return layout.status();
  FloatImage image;
  image.width = layout->width;
  image.height = layout->height;
  image.channels = std::min(layout->channels, 3);
  image.chromaticities = layout->chromaticities;
  const OIIO::ImageSpec& spec = input.spec();
  const int64_t pixels =
      std::max(int64_t{spec.width} * spec.height, int64_t{image.width} * image.height);
  if (static_cast<uint64_t>(pixels) > limits.whole_pixels_max) return image;
  absl::Status status = CheckMemory(path, *layout, spec, limits);
  if (status.ok()) status = ReadPixels(path, input, *layout, &image);
  if (!status.ok()) return status;
  if (layout->is_integer) {
    for (float& value : image.pixels) value = DecodeSrgb(value);
  }
  return image;
}

// OpenImageIO takes a '?' in a name for the beginning of options. With the format's name instead,
// the plug-in opens the path as it is.
std::unique_ptr<OIIO::ImageInput> OpenByExtension(const std::string& path,
                                                  const OIIO::ImageSpec& requested_spec,
                                                  std::string* error) {
  const size_t dot = path.rfind('.');
  const std::string format = dot == std::string::npos ? "" : path.substr(dot + 1);
  std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::create(format);
  OIIO::ImageSpec found;
  if (input && !input->open(path, found, requested_spec)) {
    *error = input->geterror();
    input = nullptr;
  }
  return input;
}

}  // namespace

std::string OneLine(std::string text, const std::string& fallback) {
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  for (char& c : text) {
    if (c == '\n') c = ' ';
  }
  return text.empty() ? fallback : text;
}

absl::StatusOr<std::unique_ptr<OIIO::ImageInput>> OpenInput(const std::string& path) {
  OIIO::ImageSpec requested_spec;
  requested_spec.attribute("oiio:UnassociatedAlpha", 1);
  std::string error;
  std::unique_ptr<OIIO::ImageInput> input = path.find('?') == std::string::npos
                                                ? OIIO::ImageInput::open(path, &requested_spec)
                                                : OpenByExtension(path, requested_spec, &error);
  if (input) return input;
  if (error.empty()) error = OIIO::geterror();
  return absl::InvalidArgumentError(
      absl::StrCat(path, ": not a readable image: ", OneLine(std::move(error), "unknown format")));
}

absl::StatusOr<FloatImage> ReadByOpenImageIO(const std::string& path,
                                             const ReadImageLimits& limits) {
  try {
    const absl::StatusOr<std::unique_ptr<OIIO::ImageInput>> input = OpenInput(path);
    if (!input.ok()) return input.status();
    return ReadOpened(path, **input, limits);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError(
        absl::StrCat(path, ": there is no memory to decode the image"));
  } catch (const std::exception& error) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": cannot be decoded: ", error.what()));
  }
}

}  // namespace sheaf
