// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/exr/exr_pixel.h"

#include <ImfInputFile.h>

#include <cstddef>
#include <stdexcept>

#include "absl/strings/str_cat.h"
#include "common/base/file.h"
#include "common/exr/exr_header_scan.h"
#include "common/film/exr/exr_attributes.h"
#include "common/film/exr/exr_streams.h"
#include "common/film/exr/stereo_views.h"

namespace sheaf {
namespace {

using PixelValues = std::vector<std::pair<std::string, float>>;

// Those of one view of a stereo image, and of no view, with their names in the image.
PixelValues OfView(const PixelValues& values, size_t view) {
  PixelValues result;
  for (const auto& [name, value] : values) {
    if (IsOfNoView(name)) result.emplace_back(name, value);
    const auto channel = ChannelOfView(name);
    if (channel && channel->first == view) result.emplace_back(channel->second, value);
  }
  return result;
}

}  // namespace

absl::StatusOr<std::vector<std::pair<std::string, float>>> ReadImagePixel(const std::string& path,
                                                                          int32_t x_px,
                                                                          int32_t y_px,
                                                                          int64_t image_bytes_max) {
  const absl::StatusOr<std::string> bytes =
      ReadWholeFile(path, static_cast<uint64_t>(image_bytes_max + kImageHeaderBytesMax));
  if (!bytes.ok()) return bytes.status();
  const absl::StatusOr<ExrFileHeader> file = ScanExrHeader(*bytes);
  if (!file.ok()) return file.status();
  if (file->deep) return absl::InvalidArgumentError("deep EXR files are not supported");
  const ExrHeader& header = file->parts[0];
  const PixelRect window = RectOf(header.data_window);
  // A stereo image continues with the right view where the left one ends.
  const auto views = header.strings.find(absl::StrCat(std::string(kMetadataPrefix), kViewsKey));
  const bool is_stereo = views != header.strings.end() && views->second == kStereoViews;
  const size_t view = is_stereo && x_px >= window.x1 ? 1 : 0;
  if (view == 1) x_px -= window.Width();
  const bool inside =
      x_px >= window.x0 && x_px < window.x1 && y_px >= window.y0 && y_px < window.y1;
  if (!inside) {
    return absl::OutOfRangeError(absl::StrCat("the image has no pixel ", x_px, ", ", y_px,
                                              "; it is ", window.x0, ",", window.y0, " to ",
                                              window.x1, ",", window.y1));
  }
  const size_t width = static_cast<size_t>(window.Width());
  const auto line_bytes_max = static_cast<uint64_t>(image_bytes_max);
  if (header.channels.size() * sizeof(float) > line_bytes_max / width) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "a line of the image needs more than the limit of ", image_bytes_max, " bytes"));
  }
  const PixelRect line{window.x0, y_px, window.x1, y_px + 1};
  std::vector<std::pair<std::string, float>> values;
  for (const ExrChannel& channel : header.channels) {
    if (!channel.subsampled) values.emplace_back(channel.name, 0.0f);
  }
  std::vector<std::vector<float>> lines(values.size(), std::vector<float>(width));
  std::vector<NamedPlane<float>> planes;
  for (size_t i = 0; i < values.size(); ++i) {
    planes.push_back({values[i].first, lines[i].data()});
  }
  absl::Status read = Guard([&] {
    MemoryInput input(*bytes);
    Imf::InputFile image(input, 0);
    if (image.header().dataWindow() != BoxOf(window)) throw std::runtime_error(kTwoWindows);
    image.setFrameBuffer(FrameBufferOf(planes, line));
    image.readPixels(y_px, y_px);
  });
  if (!read.ok()) return read;
  const auto x = static_cast<size_t>(x_px - window.x0);
  for (size_t i = 0; i < values.size(); ++i) values[i].second = lines[i][x];
  if (is_stereo) return OfView(values, view);
  return values;
}

}  // namespace sheaf
