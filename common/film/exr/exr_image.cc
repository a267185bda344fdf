// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Encodes and decodes images. Decoding scans the header first (exr_header_scan.h), so OpenEXR only
// sees sizes that have been checked.
#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>

#include <algorithm>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/file.h"
#include "common/base/status.h"
#include "common/exr/exr_header_scan.h"
#include "common/film/exr/exr_attributes.h"
#include "common/film/exr/exr_channels.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/exr/exr_format.h"
#include "common/film/exr/exr_streams.h"
#include "common/film/exr/stereo_views.h"

namespace sheaf {
namespace {

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

// The planes of one part of a file.
struct ChosenPart {
  size_t index = 0;
  std::vector<std::string> file_names, names;  // In the file and in the image, in parallel.
};

// Parts of other data windows are left out: an image has one. A name that an earlier part has too
// gets the part's name in front.
std::vector<ChosenPart> ChooseParts(const ExrFileHeader& file) {
  const ExrHeader& first = file.parts[0];
  std::vector<ChosenPart> chosen;
  std::set<std::string> taken;
  for (size_t i = 0; i < file.parts.size(); ++i) {
    const ExrHeader& header = file.parts[i];
    if (!(header.data_window == first.data_window)) continue;
    ChosenPart part{i, {}, {}};
    for (const ExrChannel& channel : header.channels) {
      if (channel.subsampled) continue;
      std::string name = ImageChannelName(channel.name);
      if (taken.contains(name)) name = channel.name;
      const auto part_name = header.strings.find("name");
      if (i > 0 && taken.contains(name) && part_name != header.strings.end()) {
        name = absl::StrCat(part_name->second, ".", name);
      }
      if (!taken.insert(name).second) continue;
      part.file_names.push_back(channel.name);
      part.names.push_back(std::move(name));
    }
    if (!part.names.empty()) chosen.push_back(std::move(part));
  }
  return chosen;
}

absl::Status CheckSize(const ExrFileHeader& file, int64_t image_bytes_max) {
  int64_t left = image_bytes_max;
  for (const ExrHeader& part : file.parts) {
    const int64_t pixels = std::max(RectOf(part.data_window).PixelCount(), part.tile_pixels);
    const auto pixel_bytes = static_cast<int64_t>(part.channels.size() * sizeof(float));
    if (pixel_bytes == 0) continue;
    if (pixels > left / pixel_bytes) {
      return absl::ResourceExhaustedError(
          absl::StrCat("the image needs more than the limit of ", image_bytes_max, " bytes"));
    }
    left -= pixels * pixel_bytes;
  }
  return absl::OkStatus();
}

absl::Status DecodeParts(std::string_view bytes, const PixelRect& window,
                         const std::vector<ChosenPart>& parts,
                         const std::vector<std::vector<NamedPlane<float>>>& planes) {
  return Guard([&] {
    MemoryInput input(bytes);
    Imf::MultiPartInputFile file(input, 0);
    for (size_t i = 0; i < parts.size(); ++i) {
      const int index = static_cast<int>(parts[i].index);
      if (index >= file.parts() || file.header(index).dataWindow() != BoxOf(window)) {
        throw std::runtime_error(kTwoWindows);
      }
      Imf::InputPart part(file, index);
      part.setFrameBuffer(FrameBufferOf(planes[i], window));
      part.readPixels(window.y0, window.y1 - 1);
    }
  });
}

}  // namespace

std::string EncodeFrameImage(const FrameImage& image) { return EncodeFrameImage(image, {}); }

absl::Status WriteFrameImage(const FrameImage& image, const std::string& path) {
  return WriteFileAtomically(path, EncodeFrameImage(image));
}

absl::StatusOr<FrameImage> DecodeFrameImage(std::string_view bytes, int64_t image_bytes_max) {
  const absl::StatusOr<ExrFileHeader> file = ScanExrHeader(bytes);
  if (!file.ok()) return file.status();
  if (file->deep)
    return absl::InvalidArgumentError(
        "deep EXR files are not supported, only images with one value per pixel");
  if (absl::Status status = CheckSize(*file, image_bytes_max); !status.ok()) return status;
  const ExrHeader& header = file->parts[0];
  FrameImage image;
  image.window = RectOf(header.data_window);
  if (header.chromaticities) {
    image.color.chromaticities = Chromaticities::FromStored(*header.chromaticities);
  }
  image.frame_width_px = header.display_window.x1;
  image.frame_height_px = header.display_window.y1;
  const std::vector<ChosenPart> parts = ChooseParts(*file);
  for (const ChosenPart& part : parts) {
    image.channel_names.insert(image.channel_names.end(), part.names.begin(), part.names.end());
  }
  if (absl::Status status = FindColor(&image.channel_names); !status.ok()) return status;
  image.planes.assign(image.channel_names.size(),
                      std::vector<float>(static_cast<size_t>(image.window.PixelCount())));
  std::vector<std::vector<NamedPlane<float>>> planes;
  size_t next = 0;
  for (const ChosenPart& part : parts) {
    std::vector<NamedPlane<float>>& of_part = planes.emplace_back();
    for (const std::string& name : part.file_names) {
      of_part.push_back({name, image.planes[next++].data()});
    }
  }
  const absl::Status decoded = file->parts.size() == 1
                                   ? DecodePlanes(bytes, image.window, planes[0], image.window)
                                   : DecodeParts(bytes, image.window, parts, planes);
  if (!decoded.ok()) return decoded;
  for (const ExrHeader& part : file->parts) ReadAttributes(part, &image);
  JoinViews(&image);
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
