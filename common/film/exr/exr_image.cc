// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Encodes and decodes images. Decoding scans the header first (exr_header_scan.h), so OpenEXR only
// sees sizes that have been checked.
#include <ImfStandardAttributes.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/file.h"
#include "common/base/status.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/exr/exr_header_scan.h"
#include "common/film/exr/exr_streams.h"

namespace sheaf {
namespace {

constexpr char kCryptomattePrefix[] = "cryptomatte/";
constexpr Imf::Compression kImageCompression = Imf::ZIP_COMPRESSION;
constexpr int kImageZipLevel = 4;

// Renames the R, G and B of the first layer that has all three to the bare names, unless these
// exist.
absl::Status FindColor(std::vector<std::string>* names) {
  const auto find = [names](const std::string& name) {
    return std::find(names->begin(), names->end(), name);
  };
  const auto has_color = [&find, names](const std::string& prefix) {
    return find(prefix + "R") != names->end() && find(prefix + "G") != names->end() &&
           find(prefix + "B") != names->end();
  };
  if (has_color("")) return absl::OkStatus();
  for (const std::string& name : *names) {
    if (!name.ends_with(".R")) continue;
    const std::string prefix = name.substr(0, name.size() - 1);
    if (!has_color(prefix)) continue;
    for (const char* component : {"R", "G", "B"}) *find(prefix + component) = component;
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError("the image has no channels R, G and B");
}

}  // namespace

std::string EncodeFrameImage(const FrameImage& image) {
  const Imath::Box2i data_window = BoxOf(image.window);
  const bool has_frame = image.frame_width_px > 0 && image.frame_height_px > 0;
  Imf::Header header(
      has_frame ? BoxOf({0, 0, image.frame_width_px, image.frame_height_px}) : data_window,
      data_window);
  header.compression() = kImageCompression;
  header.zipCompressionLevel() = kImageZipLevel;
  const std::array<float, 8> xy = image.color.chromaticities.AsStored();
  Imf::addChromaticities(header, {{xy[0], xy[1]}, {xy[2], xy[3]}, {xy[4], xy[5]}, {xy[6], xy[7]}});
  for (const auto& [key, text] : image.metadata) SetText(&header, kMetadataPrefix + key, text);
  for (const auto& [key, text] : image.attributes) SetText(&header, key, text);
  std::vector<NamedPlane<const float>> planes;
  for (size_t i = 0; i < image.planes.size(); ++i) {
    planes.push_back({image.channel_names[i], image.planes[i].data()});
  }
  return EncodePlanes(std::move(header), planes, image.window);
}

absl::Status WriteFrameImage(const FrameImage& image, const std::string& path) {
  return WriteFileAtomically(path, EncodeFrameImage(image));
}

absl::StatusOr<FrameImage> DecodeFrameImage(std::string_view bytes, int64_t image_bytes_max) {
  const absl::StatusOr<ExrFileHeader> file = ScanExrHeader(bytes);
  if (!file.ok()) return file.status();
  if (file->deep)
    return absl::InvalidArgumentError(
        "deep EXR files are not supported, only images with one value per pixel");
  for (const ExrHeader& part : file->parts) {
    const int64_t pixels = std::max(part.data_window.PixelCount(), part.tile_pixels);
    const auto pixel_bytes = static_cast<int64_t>(part.channels.size() * sizeof(float));
    if (pixel_bytes > 0 && pixels > image_bytes_max / pixel_bytes) {
      return absl::ResourceExhaustedError(
          absl::StrCat("the image needs more than the limit of ", image_bytes_max, " bytes"));
    }
  }
  const ExrHeader& header = file->parts[0];
  FrameImage image;
  image.window = header.data_window;
  if (header.chromaticities) {
    image.color.chromaticities = Chromaticities::FromStored(*header.chromaticities);
  }
  image.frame_width_px = header.display_window.x1;
  image.frame_height_px = header.display_window.y1;
  for (const ExrChannel& channel : header.channels) {
    if (!channel.subsampled) image.channel_names.push_back(channel.name);
  }
  std::vector<std::string> file_names = image.channel_names;
  if (absl::Status status = FindColor(&image.channel_names); !status.ok()) return status;
  image.planes.assign(file_names.size(),
                      std::vector<float>(static_cast<size_t>(image.window.PixelCount())));
  std::vector<NamedPlane<float>> planes;
  for (size_t i = 0; i < file_names.size(); ++i) {
    planes.push_back({file_names[i], image.planes[i].data()});
  }
  if (absl::Status status = DecodePlanes(bytes, image.window, planes, image.window); !status.ok())
    return status;
  for (const auto& [name, text] : header.strings) {
    if (name.starts_with(kMetadataPrefix))
      image.metadata[name.substr(std::strlen(kMetadataPrefix))] = text;
    if (name.starts_with(kCryptomattePrefix)) image.attributes[name] = text;
  }
  return image;
}

absl::StatusOr<FrameImage> ReadFrameImage(const std::string& path, int64_t image_bytes_max) {
  const absl::StatusOr<std::string> bytes =
      ReadWholeFile(path, static_cast<uint64_t>(image_bytes_max + kImageHeaderBytesMax));
  if (!bytes.ok()) return bytes.status();
  absl::StatusOr<FrameImage> image = DecodeFrameImage(*bytes, image_bytes_max);
  if (!image.ok()) return Annotate(image.status(), path);
  return image;
}

}  // namespace sheaf
