// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/exr/exr_format.h"

#include <ImfChannelList.h>
#include <ImfMultiPartOutputFile.h>
#include <ImfOutputPart.h>
#include <ImfPartType.h>
#include <ImfStandardAttributes.h>
#include <ImfTileDescription.h>
#include <ImfTiledOutputPart.h>
#include <half.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <iterator>
#include <new>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/film/exr/exr_attributes.h"
#include "common/film/exr/exr_channels.h"
#include "common/film/exr/exr_streams.h"
#include "common/film/exr/resumed_image.h"
#include "common/film/exr/stereo_views.h"

namespace sheaf {
namespace {

constexpr int kImageZipLevel = 4;
constexpr float kHalfMax = 65504;
constexpr char kMattes[] = "Crypto";

Imf::Compression CompressionOf(ExrCompression compression) {
  switch (compression) {
    case ExrCompression::kUncompressed:
      return Imf::NO_COMPRESSION;
    case ExrCompression::kZip:
      return Imf::ZIP_COMPRESSION;
    case ExrCompression::kZips:
      return Imf::ZIPS_COMPRESSION;
    case ExrCompression::kPiz:
      return Imf::PIZ_COMPRESSION;
    case ExrCompression::kDwaa:
      return Imf::DWAA_COMPRESSION;
    case ExrCompression::kDwab:
      break;
  }
  return Imf::DWAB_COMPRESSION;
}

// One part of a file: the channels of a layer, or all.
struct Part {
  std::string layer;             // Empty in a file of one part.
  std::vector<size_t> channels;  // Indices in the image's.
  bool is_color = true;
};

std::vector<Part> PartsOf(const FrameImage& image, const ExrFormat& format) {
  std::vector<Part> parts;
  if (!format.HasSeveralParts()) parts.emplace_back();
  for (size_t i = 0; i < image.channel_names.size(); ++i) {
    if (!format.HasSeveralParts()) {
      parts[0].channels.push_back(i);
      continue;
    }
    const std::string& name = image.channel_names[i];
    const std::string layer = LayerOfChannel(name);
    auto part = std::ranges::find(parts, layer, &Part::layer);
    if (part == parts.end()) part = parts.insert(part, Part{layer, {}, true});
    part->channels.push_back(i);
    part->is_color = part->is_color && IsColorChannel(name);
  }
  // Programs show the first part: the image itself, where it has one.
  std::stable_partition(parts.begin(), parts.end(), [&image](const Part& part) {
    return std::ranges::any_of(part.channels,
                               [&image](size_t i) { return image.channel_names[i] == "R"; });
  });
  return parts;
}

Imf::Header HeaderOf(const FrameImage& image, const ExrFormat& format, const Part& part,
                     bool is_first) {
  const Imath::Box2i data_window = BoxOf(image.window);
  const bool has_frame = image.frame_width_px > 0 && image.frame_height_px > 0;
  Imf::Header header(
      has_frame ? BoxOf({0, 0, image.frame_width_px, image.frame_height_px}) : data_window,
      data_window);
  header.compression() =
      format.IsDwa() && !part.is_color ? Imf::ZIP_COMPRESSION : CompressionOf(format.compression);
  header.zipCompressionLevel() = kImageZipLevel;
  const std::array<float, 8> xy = image.color.chromaticities.AsStored();
  Imf::addChromaticities(header, {{xy[0], xy[1]}, {xy[2], xy[3]}, {xy[4], xy[5]}, {xy[6], xy[7]}});
  SetScreenWindow(image, &header);
  if (is_first) SetAttributes(image, &header);
  if (is_first && IsStereoImage(image)) {
    Imf::addMultiView(header, {std::begin(kViewNames), std::end(kViewNames)});
  }
  if (is_first && !RoundingOf(format).empty()) {
    SetText(&header, std::string(kMetadataPrefix) + kRoundingKey, RoundingOf(format));
  }
  if (!is_first && part.layer.starts_with(kMattes)) {
    SetMatteAttributes(image, part.layer, &header);
  }
  if (format.tile_size_px > 0) {
    const auto edge = static_cast<unsigned>(format.tile_size_px);
    header.setTileDescription(Imf::TileDescription(edge, edge, Imf::ONE_LEVEL));
  }
  if (format.HasSeveralParts()) header.setName(part.layer);
  header.setType(format.tile_size_px > 0 ? Imf::TILEDIMAGE : Imf::SCANLINEIMAGE);
  for (const size_t i : part.channels) {
    const bool is_half = format.type == ExrType::kHalf && IsColorChannel(image.channel_names[i]);
    header.channels().insert(FileChannelName(image.channel_names[i]),
                             Imf::Channel(is_half ? Imf::HALF : Imf::FLOAT));
  }
  return header;
}

// The nearest 16-bit floats; finite values stay finite.
std::vector<half> HalvesOf(const std::vector<float>& plane) {
  std::vector<half> halves(plane.size());
  std::ranges::transform(plane, halves.begin(), [](float value) {
    return half(std::isfinite(value) ? std::clamp(value, -kHalfMax, kHalfMax) : value);
  });
  return halves;
}

void WritePart(const FrameImage& image, const ExrFormat& format, const Part& part, int index,
               Imf::MultiPartOutputFile* file) {
  Imf::FrameBuffer buffer;
  const Imath::Box2i window = BoxOf(image.window);
  std::deque<std::vector<half>> halves;
  for (const size_t i : part.channels) {
    const std::string& name = image.channel_names[i];
    const bool is_half = format.type == ExrType::kHalf && IsColorChannel(name);
    if (is_half) halves.push_back(HalvesOf(image.planes[i]));
    buffer.insert(FileChannelName(name),
                  is_half ? Imf::Slice::Make(Imf::HALF, halves.back().data(), window)
                          : Imf::Slice::Make(Imf::FLOAT, image.planes[i].data(), window));
  }
  if (format.tile_size_px > 0) {
    Imf::TiledOutputPart tiles(*file, index);
    tiles.setFrameBuffer(buffer);
    tiles.writeTiles(0, tiles.numXTiles() - 1, 0, tiles.numYTiles() - 1);
  } else {
    Imf::OutputPart lines(*file, index);
    lines.setFrameBuffer(buffer);
    lines.writePixels(image.window.Height());
  }
}

}  // namespace

const char* ExrTypeName(ExrType type) { return type == ExrType::kHalf ? "half" : "float"; }

const char* ExrCompressionName(ExrCompression compression) {
  static constexpr const char* kNames[] = {"none", "zip", "zips", "piz", "dwaa", "dwab"};
  return kNames[static_cast<size_t>(compression)];
}

const char* ExrPartsName(ExrParts parts) { return parts == ExrParts::kMulti ? "multi" : "single"; }

std::string RoundingOf(const ExrFormat& format) {
  std::string rounding = format.type == ExrType::kHalf ? ExrTypeName(format.type) : "";
  if (format.IsDwa()) {
    absl::StrAppend(&rounding, rounding.empty() ? "" : ", ",
                    ExrCompressionName(format.compression));
  }
  return rounding;
}

absl::Status CheckExrFormat(const ExrFormat& format) {
  if (format.IsDwa() && !format.HasSeveralParts()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the compression ", ExrCompressionName(format.compression),
        " loses precision of all R, G and B of a part, which makes ids and errors wrong; write "
        "several parts (--exr-parts multi), which keeps data in parts without loss, or use zip or "
        "piz"));
  }
  const int32_t edge = format.tile_size_px;
  if (edge != 0 && (edge < kExrTileSizePxMin || edge > kExrTileSizePxMax)) {
    return absl::InvalidArgumentError(absl::StrCat("tiles of ", edge, " pixels are outside [",
                                                   kExrTileSizePxMin, ", ", kExrTileSizePxMax,
                                                   "]; 0 writes scan lines"));
  }
  return absl::OkStatus();
}

int64_t CountBeyondHalf(const FrameImage& image) {
  int64_t count = 0;
  for (size_t i = 0; i < image.planes.size(); ++i) {
    if (!IsColorChannel(image.channel_names[i])) continue;
    count +=
        std::ranges::count_if(image.planes[i], [](float v) { return std::fabs(v) > kHalfMax; });
  }
  return count;
}

std::string EncodeFrameImage(const FrameImage& whole, const ExrFormat& format) {
  SHEAF_CHECK(CheckExrFormat(format).ok());
  const bool is_stereo = IsStereoImage(whole) && whole.window.Width() % 2 == 0;
  const FrameImage split = is_stereo ? SplitViews(whole) : FrameImage();
  const FrameImage& image = is_stereo ? split : whole;
  const std::vector<Part> parts = PartsOf(image, format);
  std::vector<Imf::Header> headers;
  for (const Part& part : parts) {
    headers.push_back(HeaderOf(image, format, part, headers.empty()));
  }
  MemoryOutput output(0);
  WriteToMemory([&] {
    Imf::MultiPartOutputFile file(output, headers.data(), static_cast<int>(headers.size()), false,
                                  0);
    for (size_t i = 0; i < parts.size(); ++i) {
      WritePart(image, format, parts[i], static_cast<int>(i), &file);
    }
  });
  return output.Take();
}

}  // namespace sheaf
