// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include <ImfFrameBuffer.h>
#include <ImfInputFile.h>
#include <half.h>

#include <algorithm>
#include <exception>

#include "common/exr/exr_header_scan.h"
#include "common/image/channel_names.h"
#include "common/image/plain_formats.h"

namespace sheaf {
namespace {

// The one part, if it has the form that this reader takes.
const ExrHeader* PartOf(const ExrFileHeader& file) {
  if (file.deep || file.parts.size() != 1) return nullptr;
  const ExrHeader& part = file.parts[0];
  return part.data_window == part.display_window ? &part : nullptr;
}

void ReadPixels(const std::string& path, const ExrHeader& part,
                const std::vector<const ExrChannel*>& channels, PlainImage* image) {
  const bool is_half = image->type == PlainImage::Type::kHalf;
  const size_t number = image->NumberBytes(), pixel = number * channels.size();
  const size_t row = pixel * static_cast<size_t>(image->width);
  // OpenEXR takes the address that the pixel (0, 0) would have.
  const std::ptrdiff_t origin = part.data_window.x0 * static_cast<std::ptrdiff_t>(pixel) +
                                part.data_window.y0 * static_cast<std::ptrdiff_t>(row);
  Imf::FrameBuffer frame;
  for (size_t c = 0; c < channels.size(); ++c) {
    char* begin = reinterpret_cast<char*>(image->numbers.data()) + c * number;
    frame.insert(channels[c]->name,
                 Imf::Slice(is_half ? Imf::HALF : Imf::FLOAT, begin - origin, pixel, row));
  }
  Imf::InputFile file(path.c_str(), 0);
  file.setFrameBuffer(frame);
  file.readPixels(part.data_window.y0, part.data_window.y1 - 1);
}

}  // namespace

float FloatOfHalf(uint16_t bits) {
  half number;
  number.setBits(bits);
  return number;
}

std::optional<PlainImage> ReadExr(const std::string& path, const PlainRequest& request) {
  const absl::StatusOr<std::optional<ExrFileHeader>> file = ReadExrHeader(path);
  if (!file.ok() || !*file) return std::nullopt;
  const ExrHeader* part = PartOf(**file);
  if (part == nullptr) return std::nullopt;
  std::vector<std::string> names;
  for (const ExrChannel& channel : part->channels) names.push_back(channel.name);
  std::vector<const ExrChannel*> channels;
  for (const int place : ColorChannelsOf(names)) channels.push_back(&part->channels[place]);
  if (channels.empty()) return std::nullopt;
  const ExrChannel::Type type = channels[0]->type;
  // Which of the image's channels decide how all of them are stored is OpenImageIO's rule.
  for (const ExrChannel& channel : part->channels) {
    if (channel.subsampled || channel.type != type) return std::nullopt;
  }
  if (type == ExrChannel::Type::kUint) return std::nullopt;
  const ExrWindow& window = part->data_window;
  std::optional<PlainImage> image = MakePlainImage(
      int64_t{window.x1} - window.x0, int64_t{window.y1} - window.y0,
      static_cast<int>(channels.size()),
      type == ExrChannel::Type::kHalf ? PlainImage::Type::kHalf : PlainImage::Type::kFloat,
      request);
  if (!image) return std::nullopt;
  if (channels.size() >= 3) image->chromaticities = part->chromaticities;
  if (request.is_header_enough) return image;
  try {
    ReadPixels(path, *part, channels, &*image);
  } catch (const std::exception&) {
    return std::nullopt;
  }
  return image;
}

}  // namespace sheaf
