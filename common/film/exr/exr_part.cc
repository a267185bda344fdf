// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Encodes and decodes parts. Both directions take the same three steps: name the planes, describe
// them in a header, and let OpenEXR transfer them between file and memory. Decoding scans the
// header first (exr_header_scan.h), so OpenEXR only sees sizes that have been checked.
#include <ImfInputFile.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/exr/exr_streams.h"
#include "common/film/exr/part_planes.h"
#include "common/film/id_planes.h"
#include "common/exr/exr_header_scan.h"

namespace sheaf {
namespace {

constexpr char kFormatKey[] = "sheaf:format", kFormat[] = "film-part 1";
constexpr char kFrameDigestAttribute[] = "sheaf:frameDigest",
               kProfileKey[] = "sheaf:numericProfile";
constexpr char kBlockFirstKey[] = "sheaf:blockFirst", kBlockCountKey[] = "sheaf:blockCount";
constexpr char kIdsKey[] = "sheaf:ids.";  // Followed by the kind's name.
// Only with a lattice.
constexpr char kPixelStrideKey[] = "sheaf:pixelStridePx", kPixelSeedKey[] = "sheaf:pixelSeed";
constexpr char kCellSizeKey[] = "sheaf:cellSizePx";  // Only in a part of some cells.
constexpr char kCellsKey[] = "sheaf:cells";
constexpr char kKindKey[] = "sheaf:kind";        // Only of light passes.
constexpr char kOutputsKey[] = "sheaf:outputs";  // Only if there are any.
// Sums of noise hardly compress, and the gain is not worth the time: for a part of 32x32 pixels and
// 16 samples a run-length coding saves an eighth of the bytes, and takes seven times as long to
// encode, ten times to decode (tests/bench/part_bench.cc); ZIP and PIZ are slower still. But most
// of a lattice's pixels are empty, and so are most planes of light passes.
bool IsCompressed(const PixelLattice& lattice, TaskKind kind) {
  return !lattice.All() || kind == TaskKind::kLight;
}
Imf::Compression CompressionOf(const PixelLattice& lattice, TaskKind kind) {
  return IsCompressed(lattice, kind) ? Imf::RLE_COMPRESSION : Imf::NO_COMPRESSION;
}
// The maximum number of bytes from one compressed byte. A run of at most 128 becomes two bytes, so
// a few bytes cannot request gigabytes.
int64_t ExpansionMaxOf(const PixelLattice& lattice, TaskKind kind) {
  return IsCompressed(lattice, kind) ? 64 : 1;
}

absl::Status NotAPart(const std::string& why) {
  return absl::InvalidArgumentError(absl::StrCat("not a film part: ", why));
}

// Whether EncodePart could have written the header, except for the fields that the functions below
// read.
absl::Status CheckPartHeader(const ExrFileHeader& file) {
  const ExrHeader& header = file.parts[0];
  if (file.deep || file.parts.size() != 1 || header.tile_pixels != 0) {
    return NotAPart("it is not a flat scan-line file");
  }
  if (header.line_order != Imf::INCREASING_Y) return NotAPart("unexpected line order");
  static constexpr std::string_view kTypes[] = {"chlist", "compression", "box2i", "lineOrder",
                                                "float",  "v2f",         "string"};
  for (const auto& [name, type] : header.types) {
    if (std::find(std::begin(kTypes), std::end(kTypes), type) == std::end(kTypes)) {
      return NotAPart(absl::StrCat("unexpected attribute \"", name, "\""));
    }
  }
  for (const char* key :
       {kFormatKey, kFrameDigestAttribute, kProfileKey, kBlockFirstKey, kBlockCountKey}) {
    if (!header.strings.contains(key)) return NotAPart(absl::StrCat("no attribute \"", key, "\""));
  }
  if (header.strings.at(kFormatKey) != kFormat) return NotAPart("unknown format version");
  return absl::OkStatus();
}

absl::StatusOr<SampleBlock> BlockOf(const ExrHeader& header) {
  SampleBlock block;
  if (!absl::SimpleAtoi(header.strings.at(kBlockFirstKey), &block.first) ||
      !absl::SimpleAtoi(header.strings.at(kBlockCountKey), &block.count) || !IsAligned(block)) {
    return NotAPart("its samples are not an aligned block");
  }
  return block;
}

absl::StatusOr<PixelLattice> LatticeOf(const ExrHeader& header) {
  PixelLattice lattice;
  if (const auto stride = header.strings.find(kPixelStrideKey); stride != header.strings.end()) {
    const auto seed = header.strings.find(kPixelSeedKey);
    if (!absl::SimpleAtoi(stride->second, &lattice.stride_px) ||
        lattice.stride_px < kPixelStrideMin || lattice.stride_px > kPixelStrideMax ||
        header.data_window.x0 < 0 || header.data_window.y0 < 0 || seed == header.strings.end() ||
        !absl::SimpleAtoi(seed->second, &lattice.seed)) {
      return NotAPart("invalid pixel stride or seed");
    }
  }
  return lattice;
}

absl::StatusOr<TaskKind> KindOf(const ExrHeader& header) {
  const auto text = header.strings.find(kKindKey);
  if (text == header.strings.end()) return TaskKind::kCamera;
  if (text->second == TaskKindName(TaskKind::kLight)) return TaskKind::kLight;
  return NotAPart("unknown kind of task");
}

absl::StatusOr<FilmOutputs> OutputsOf(const ExrHeader& header) {
  const auto text = header.strings.find(kOutputsKey);
  if (text == header.strings.end()) return FilmOutputs{};
  absl::StatusOr<FilmOutputs> outputs = ParseOutputs(text->second);
  if (!outputs.ok()) return NotAPart(std::string(outputs.status().message()));
  return outputs;
}

absl::StatusOr<TileCells> CellsOf(const ExrHeader& header) {
  const auto size = header.strings.find(kCellSizeKey);
  if (size == header.strings.end()) return TileCells{};
  const auto mask = header.strings.find(kCellsKey);
  TileCells cells;
  if (mask == header.strings.end() || !absl::SimpleAtoi(size->second, &cells.size_px) ||
      !absl::SimpleAtoi(mask->second, &cells.mask)) {
    return NotAPart("its cells cannot be read");
  }
  const std::string why = WhyNoCells(RectOf(header.display_window), cells);
  if (!why.empty()) return NotAPart(why);
  return cells;
}

// The data window of a part's file. A part of the whole tile is stored as an image of it; a part of
// some cells as one line per cell, row by row, so that the pixels between cells take no bytes.
// Cells at the edge are smaller: the rest of their line is empty.
PixelRect DataWindowOf(const PixelRect& tile, const TileCells& cells) {
  if (cells.All()) return tile;
  const std::vector<PixelRect> rects = RectsOf(tile, cells);
  int64_t width = 0;  // At most the tile's pixels, whose number fits int32_t.
  for (const PixelRect& rect : rects) width = std::max(width, rect.PixelCount());
  return {tile.x0, tile.y0, tile.x0 + static_cast<int32_t>(width),
          tile.y0 + static_cast<int32_t>(rects.size())};
}

// The row of the tile, or the cell, that is stored in line `line` of such a file.
PixelRect RectOfLine(const PixelRect& tile, const TileCells& cells,
                     const std::vector<PixelRect>& rects, size_t line) {
  if (!cells.All()) return rects[line];
  const int32_t y = tile.y0 + static_cast<int32_t>(line);
  return {tile.x0, y, tile.x1, y + 1};
}

// The tile's planes, packed into the lines of DataWindowOf.
struct PackedPlanes {
  std::vector<float> pixels;
  std::vector<NamedPlane<const float>> planes;
};
PackedPlanes Pack(const std::vector<NamedPlane<const float>>& planes, const PixelRect& tile,
                  const TileCells& cells) {
  const std::vector<PixelRect> rects = RectsOf(tile, cells);
  const PixelRect window = DataWindowOf(tile, cells);
  const auto width = static_cast<size_t>(window.Width());
  PackedPlanes packed;
  packed.pixels.resize(static_cast<size_t>(window.PixelCount()) * planes.size());
  float* line = packed.pixels.data();
  for (const NamedPlane<const float>& plane : planes) {
    packed.planes.push_back({plane.name, line});
    for (const PixelRect& rect : rects) {
      float* row = line;
      for (int32_t y = rect.y0; y < rect.y1; ++y) {
        row = std::copy_n(plane.pixels + tile.IndexOf(rect.x0, y), rect.Width(), row);
      }
      line += width;
    }
  }
  return packed;
}

std::array<size_t, kIdKindCount> CountIdPlanes(const ExrHeader& header) {
  std::array<size_t, kIdKindCount> counts{};
  for (size_t i = 0; i < kIdKindCount; ++i) {
    for (const ExrChannel& channel : header.channels) {
      counts[i] += IsIdPlaneName(static_cast<IdKind>(i), channel.name) ? 1 : 0;
    }
  }
  return counts;
}

// planes: sorted by name, as in files.
absl::Status CheckPartChannels(const ExrHeader& header,
                               const std::vector<NamedPlane<float>>& planes) {
  for (size_t i = 0; i < planes.size(); ++i) {
    const ExrChannel& channel = header.channels[i];
    if (channel.name != planes[i].name) return NotAPart("wrong channels");
    if (channel.type != ExrChannel::Type::kFloat || channel.subsampled) {
      return NotAPart(absl::StrCat("channel \"", channel.name, "\" is not float32"));
    }
  }
  return absl::OkStatus();
}

// Reads an uncompressed file with exactly these planes, sorted by name. Copies whole lines: OpenEXR
// assembles each float from single bytes, which takes five times as long.
absl::Status DecodeLines(std::string_view bytes, const std::vector<NamedPlane<float>>& planes,
                         const PixelRect& tile, const TileCells& cells) {
  static_assert(std::endian::native == std::endian::little, "as EXR files are");
  return Guard([&] {
    MemoryInput input(bytes);
    Imf::InputFile file(input, 0);
    const PixelRect window = DataWindowOf(tile, cells);
    if (file.header().dataWindow() != BoxOf(window)) throw std::runtime_error(kTwoWindows);
    const std::vector<PixelRect> rects = RectsOf(tile, cells);
    const size_t line_bytes = static_cast<size_t>(window.Width()) * sizeof(float);
    for (int32_t i = 0; i < window.Height(); ++i) {
      const char* line = nullptr;
      int size_bytes = 0;
      file.rawPixelData(window.y0 + i, line, size_bytes);
      if (static_cast<size_t>(size_bytes) != planes.size() * line_bytes) {
        throw std::runtime_error("a line has a wrong length");
      }
      const PixelRect rect = RectOfLine(tile, cells, rects, static_cast<size_t>(i));
      const size_t row_bytes = static_cast<size_t>(rect.Width()) * sizeof(float);
      for (const NamedPlane<float>& plane : planes) {
        const char* row = line;
        for (int32_t y = rect.y0; y < rect.y1; ++y, row += row_bytes) {
          std::memcpy(plane.pixels + tile.IndexOf(rect.x0, y), row, row_bytes);
        }
        line += line_bytes;
      }
    }
  });
}

// The layout declared by a part's header, checked before memory is allocated for its planes.
struct PartLayout {
  PartHeader header;
  SampleBlock block;
  FilmOutputs outputs;
  std::array<size_t, kIdKindCount> id_plane_counts{};
};

absl::StatusOr<PartLayout> LayoutOf(const ExrFileHeader& file, size_t size_bytes,
                                    int64_t part_pixels_max) {
  if (absl::Status status = CheckPartHeader(file); !status.ok()) return status;
  const ExrHeader& header = file.parts[0];
  const PixelRect tile = RectOf(header.display_window);
  if (tile.PixelCount() > part_pixels_max) {
    return NotAPart(
        absl::StrCat(tile.PixelCount(), " pixels are more than the limit of ", part_pixels_max));
  }
  const absl::StatusOr<SampleBlock> block = BlockOf(header);
  if (!block.ok()) return block.status();
  const absl::StatusOr<PixelLattice> lattice = LatticeOf(header);
  if (!lattice.ok()) return lattice.status();
  const absl::StatusOr<TileCells> cells = CellsOf(header);
  if (!cells.ok()) return cells.status();
  const absl::StatusOr<TaskKind> kind = KindOf(header);
  if (!kind.ok()) return kind.status();
  if (header.compression != CompressionOf(*lattice, *kind)) {
    return NotAPart("unexpected compression");
  }
  if (!lattice->All() && !cells->All()) return NotAPart("it has cells of a lattice");
  if (*kind == TaskKind::kLight && (!lattice->All() || !cells->All())) {
    return NotAPart("its light passes do not have all pixels");
  }
  if (!(RectOf(header.data_window) == DataWindowOf(tile, *cells))) {
    return NotAPart("it has other pixels than its tile, or its cells");
  }
  const int64_t raw_bytes = RectOf(header.data_window).PixelCount() *
                            static_cast<int64_t>(header.channels.size() * sizeof(float));
  if (raw_bytes / ExpansionMaxOf(*lattice, *kind) > static_cast<int64_t>(size_bytes)) {
    return absl::DataLossError("the film part is too short for its size in pixels");
  }
  absl::StatusOr<FilmOutputs> outputs = OutputsOf(header);
  if (!outputs.ok()) return outputs.status();
  PartLayout layout{{header.strings.at(kFrameDigestAttribute), header.strings.at(kProfileKey),
                     *lattice, *cells, *kind},
                    *block,
                    *std::move(outputs),
                    CountIdPlanes(header)};
  size_t channel_count = kFilmChannelCount + 2 * MeanChannelCount(layout.outputs) +
                         std::min<uint64_t>(block->count, kReplicateCount) * kReplicateChannelCount;
  for (size_t i = 0; i < kIdKindCount; ++i) {
    channel_count += layout.id_plane_counts[i];
    const bool has_ids = layout.outputs.HasIds(static_cast<IdKind>(i));
    if (layout.id_plane_counts[i] > 0 && !has_ids) return NotAPart("wrong channels");
  }
  if (header.channels.size() != channel_count) return NotAPart("wrong channels");
  return layout;
}

}  // namespace

std::string EncodePart(const FilmTile& tile, const PartHeader& part) {
  Imf::Header header(BoxOf(tile.rect()), BoxOf(DataWindowOf(tile.rect(), part.cells)));
  header.compression() = CompressionOf(part.lattice, part.kind);
  SetText(&header, kFormatKey, kFormat);
  SetText(&header, kFrameDigestAttribute, part.frame_digest);
  SetText(&header, kProfileKey, part.numeric_profile);
  SetText(&header, kBlockFirstKey, absl::StrCat(tile.block().first));
  SetText(&header, kBlockCountKey, absl::StrCat(tile.block().count));
  if (!part.lattice.All()) {
    SetText(&header, kPixelStrideKey, absl::StrCat(part.lattice.stride_px));
    SetText(&header, kPixelSeedKey, absl::StrCat(part.lattice.seed));
  }
  if (!part.cells.All()) {
    SetText(&header, kCellSizeKey, absl::StrCat(part.cells.size_px));
    SetText(&header, kCellsKey, absl::StrCat(part.cells.mask));
  }
  if (part.kind != TaskKind::kCamera) SetText(&header, kKindKey, TaskKindName(part.kind));
  if (!tile.outputs().empty()) SetText(&header, kOutputsKey, FormatOutputs(tile.outputs()));
  std::vector<NamedPlane<const float>> planes = PlanesOf<const float>(tile);
  std::vector<std::vector<float>> id_planes;
  for (size_t i = 0; i < kIdKindCount; ++i) {
    const auto kind = static_cast<IdKind>(i);
    if (!tile.outputs().HasIds(kind)) continue;
    SetText(&header, kIdsKey + std::string(IdKindName(kind)), NamesText(tile.ids(kind).names));
    std::vector<std::vector<float>> own = IdPlanes(tile.ids(kind));
    for (size_t k = 0; k < own.size(); ++k) {
      // A vector's memory stays where it is when the vector is moved.
      planes.push_back({IdPlaneName(kind, k), own[k].data()});
      id_planes.push_back(std::move(own[k]));
    }
  }
  if (part.cells.All()) return EncodePlanes(std::move(header), planes, tile.rect());
  return EncodePlanes(std::move(header), Pack(planes, tile.rect(), part.cells).planes,
                      DataWindowOf(tile.rect(), part.cells));
}

absl::StatusOr<DecodedPart> DecodePart(std::string_view bytes, int64_t part_pixels_max) {
  const absl::StatusOr<ExrFileHeader> file = ScanExrHeader(bytes);
  if (!file.ok()) return file.status();
  const ExrHeader& header = file->parts[0];
  absl::StatusOr<PartLayout> layout = LayoutOf(*file, bytes.size(), part_pixels_max);
  if (!layout.ok()) return layout.status();
  DecodedPart part{
      FilmTile(RectOf(header.display_window), layout->block, std::move(layout->outputs)),
      std::move(layout->header)};
  std::vector<NamedPlane<float>> planes = PlanesOf<float>(part.tile);
  std::array<std::vector<std::vector<float>>, kIdKindCount> id_planes;
  for (size_t i = 0; i < kIdKindCount; ++i) {
    id_planes[i].assign(layout->id_plane_counts[i], std::vector<float>(part.tile.plane_size()));
    for (size_t k = 0; k < id_planes[i].size(); ++k) {
      planes.push_back({IdPlaneName(static_cast<IdKind>(i), k), id_planes[i][k].data()});
    }
  }
  std::ranges::sort(planes, {}, &NamedPlane<float>::name);
  if (absl::Status status = CheckPartChannels(header, planes); !status.ok()) return status;
  const PixelRect& tile = part.tile.rect();
  const absl::Status decoded = IsCompressed(part.header.lattice, part.header.kind)
                                   ? DecodePlanes(bytes, RectOf(header.data_window), planes, tile)
                                   : DecodeLines(bytes, planes, tile, part.header.cells);
  if (!decoded.ok()) return decoded;
  const std::string why = part.header.kind == TaskKind::kLight
                              ? WhyNoLightPasses(part.tile)
                              : WhyNoSums(part.tile, part.header.lattice, part.header.cells);
  if (!why.empty()) return NotAPart(why);
  for (size_t i = 0; i < kIdKindCount; ++i) {
    const auto kind = static_cast<IdKind>(i);
    if (!part.tile.outputs().HasIds(kind)) continue;
    const auto names = header.strings.find(kIdsKey + std::string(IdKindName(kind)));
    if (names == header.strings.end()) return NotAPart("its ids have no names");
    const absl::Status status = ReadIds(names->second, id_planes[i], &part.tile.ids(kind));
    if (!status.ok()) return NotAPart(std::string(status.message()));
  }
  return part;
}

}  // namespace sheaf
