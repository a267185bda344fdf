// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/exr/exr_header_scan.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <fstream>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"

namespace sheaf {
namespace {

static_assert(std::endian::native == std::endian::little,
              "EXR is little-endian and read as it lies");

constexpr std::string_view kMagic("\x76\x2f\x31\x01", 4);
constexpr uint32_t kVersion = 2;
constexpr uint32_t kTiledFlag = 0x200, kLongNamesFlag = 0x400, kDeepFlag = 0x800,
                   kPartsFlag = 0x1000;
constexpr size_t kNameSizeMax = 255;
constexpr size_t kChannelsMax = 4096;
constexpr size_t kPartsMax = 1024;
// Coordinates beyond this occur in no real image and would overflow 32-bit sums.
constexpr int32_t kCoordinateMax = 1 << 30;

// Takes values off the front of a range; after the first failure every call fails.
class ByteReader {
 public:
  explicit ByteReader(std::string_view bytes) : bytes_(bytes) {}
  template <typename T>
  T Take() {
    T value{};
    if (const std::string_view raw = TakeBytes(sizeof(T)); raw.size() == sizeof(T)) {
      std::memcpy(&value, raw.data(), sizeof(T));
    }
    return value;
  }
  std::string_view TakeBytes(size_t size) {
    if (failed_ || size > bytes_.size()) {
      failed_ = true;
      return {};
    }
    const std::string_view front = bytes_.substr(0, size);
    bytes_.remove_prefix(size);
    return front;
  }
  // A zero-terminated string.
  std::string TakeName() {
    const size_t end = bytes_.substr(0, kNameSizeMax + 1).find('\0');
    if (end == std::string_view::npos) failed_ = true;
    const std::string_view name = TakeBytes(failed_ ? 0 : end);
    TakeBytes(1);
    return std::string(name);
  }
  bool failed() const { return failed_; }
  bool empty() const { return bytes_.empty(); }
  size_t size() const { return bytes_.size(); }

 private:
  std::string_view bytes_;
  bool failed_ = false;
};

absl::Status Malformed(std::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat("not a valid EXR file: ", std::string(what)));
}
absl::Status Truncated() { return absl::DataLossError("the EXR file ends within its header"); }

// Sizes of the types with fixed-size values. A reader that trusts the type and one that trusts the
// size must parse the same file.
std::optional<size_t> FixedSize(const std::string& type) {
  static constexpr std::pair<std::string_view, size_t> kSizes[] = {
      {"box2i", 16},   {"box2f", 16},          {"compression", 1}, {"lineOrder", 1},
      {"float", 4},    {"double", 8},          {"int", 4},         {"v2f", 8},
      {"v2i", 8},      {"tiledesc", 9},        {"v3f", 12},        {"v3i", 12},
      {"rational", 8}, {"chromaticities", 32}, {"keycode", 28},    {"m33f", 36},
      {"m44f", 64},    {"timecode", 8},        {"envmap", 1},      {"m33d", 72},
      {"m44d", 128},   {"v2d", 16},            {"v3d", 24},        {"deepImageState", 1}};
  for (const auto& [name, size] : kSizes) {
    if (name == type) return size;
  }
  return std::nullopt;
}

absl::StatusOr<ExrWindow> ParseWindow(std::string_view value) {
  ByteReader reader(value);
  const auto x0 = reader.Take<int32_t>(), y0 = reader.Take<int32_t>();
  const auto x1 = reader.Take<int32_t>(), y1 = reader.Take<int32_t>();
  for (const int32_t c : {x0, y0, x1, y1}) {
    if (c < -kCoordinateMax || c > kCoordinateMax) return Malformed("a window is out of bounds");
  }
  if (x1 < x0 || y1 < y0) return Malformed("a window is empty");
  return ExrWindow{x0, y0, x1 + 1, y1 + 1};
}

absl::Status ParseChannels(std::string_view value, std::vector<ExrChannel>* channels) {
  ByteReader reader(value);
  while (true) {
    ExrChannel channel;
    channel.name = reader.TakeName();
    if (reader.failed()) return Malformed("the channel list does not end");
    if (channel.name.empty()) break;
    const auto type = reader.Take<int32_t>();
    reader.TakeBytes(4);  // pLinear and three reserved bytes.
    const auto x_sampling = reader.Take<int32_t>(), y_sampling = reader.Take<int32_t>();
    if (type < 0 || type > 2) return Malformed("a channel has an unknown type");
    if (x_sampling < 1 || y_sampling < 1) return Malformed("a channel has no sampling rate");
    channel.type = static_cast<ExrChannel::Type>(type);
    channel.subsampled = x_sampling != 1 || y_sampling != 1;
    channels->push_back(std::move(channel));
    if (channels->size() > kChannelsMax) return Malformed("too many channels");
  }
  return reader.empty() ? absl::OkStatus() : Malformed("the channel list has extra bytes");
}

// Each text has its own length, which must end within the list.
absl::Status CheckTexts(std::string_view value) {
  ByteReader reader(value);
  while (!reader.empty()) {
    const auto size = reader.Take<int32_t>();
    if (size < 0) return Malformed("a list of texts has a negative size");
    reader.TakeBytes(static_cast<size_t>(size));
    if (reader.failed()) return Malformed("a list of texts does not end");
  }
  return absl::OkStatus();
}

// A picture of four bytes a pixel.
absl::Status CheckPreview(std::string_view value) {
  ByteReader reader(value);
  const auto width = reader.Take<uint32_t>(), height = reader.Take<uint32_t>();
  if (reader.failed() || (height > 0 && reader.size() / 4 / height != width) ||
      reader.size() != size_t{4} * width * height) {
    return Malformed("a preview has the wrong size");
  }
  return absl::OkStatus();
}

// Checks that a value of variable size ends where the attribute does, so that a reader that trusts
// the value and one that trusts the size continue at the same byte.
absl::Status CheckEnd(const std::string& name, const std::string& type, std::string_view value) {
  if (type == "stringvector") return CheckTexts(value);
  if (type == "preview") return CheckPreview(value);
  if (type == "floatvector" && value.size() % sizeof(float) != 0) {
    return Malformed(absl::StrCat("attribute \"", name, "\" has the wrong size for a ", type));
  }
  if (type == "chlist" && name != "channels") {
    std::vector<ExrChannel> unused;
    return ParseChannels(value, &unused);
  }
  return absl::OkStatus();
}

absl::Status ParseTileSize(std::string_view value, ExrHeader* header) {
  ByteReader reader(value);
  const auto width = reader.Take<uint32_t>(), height = reader.Take<uint32_t>();
  if (width == 0 || height == 0 || width > kCoordinateMax || height > kCoordinateMax) {
    return Malformed("the tiles have an invalid size");
  }
  header->tile_pixels = static_cast<int64_t>(width) * height;
  return absl::OkStatus();
}

absl::Status ParseAttribute(const std::string& name, const std::string& type,
                            std::string_view value, ExrHeader* header) {
  if (!header->types.emplace(name, type).second) {
    return Malformed(absl::StrCat("attribute \"", name, "\" is repeated"));
  }
  if (const std::optional<size_t> size = FixedSize(type); size && *size != value.size()) {
    return Malformed(absl::StrCat("attribute \"", name, "\" has the wrong size for a ", type));
  }
  if (absl::Status status = CheckEnd(name, type, value); !status.ok()) return status;
  if (type == "string") header->strings[name] = std::string(value);
  static constexpr std::string_view kNumbers[] = {"int", "float", "rational",
                                                  "v2i", "box2i", "m44f"};
  if (std::ranges::find(kNumbers, type) != std::end(kNumbers)) {
    header->numbers[name] = std::string(value);
  }
  static constexpr std::pair<std::string_view, std::string_view> kNeeded[] = {
      {"channels", "chlist"},         {"dataWindow", "box2i"},    {"displayWindow", "box2i"},
      {"compression", "compression"}, {"lineOrder", "lineOrder"}, {"tiles", "tiledesc"}};
  for (const auto& [needed, needed_type] : kNeeded) {
    if (name == needed && type != needed_type) {
      return Malformed(absl::StrCat("attribute \"", name, "\" is a ", type));
    }
  }
  if (name == "channels") return ParseChannels(value, &header->channels);
  if (name == "tiles") return ParseTileSize(value, header);
  if (name == "chromaticities" && type == name) {
    ByteReader reader(value);
    header->chromaticities.emplace();
    for (float& xy : *header->chromaticities) xy = reader.Take<float>();
  }
  if (name == "compression") header->compression = static_cast<uint8_t>(value[0]);
  if (name == "lineOrder") header->line_order = static_cast<uint8_t>(value[0]);
  if (name == "dataWindow" || name == "displayWindow") {
    const absl::StatusOr<ExrWindow> window = ParseWindow(value);
    if (!window.ok()) return window.status();
    (name == "dataWindow" ? header->data_window : header->display_window) = *window;
  }
  return absl::OkStatus();
}

// Reads attributes up to the zero byte that ends the list.
absl::Status ParseHeader(ByteReader* reader, ExrHeader* header) {
  while (true) {
    const std::string name = reader->TakeName();
    if (reader->failed()) return Truncated();
    if (name.empty()) break;
    const std::string type = reader->TakeName();
    const auto size = reader->Take<int32_t>();
    if (reader->failed()) return Truncated();
    if (size < 0) return Malformed(absl::StrCat("attribute \"", name, "\" has a negative size"));
    const std::string_view value = reader->TakeBytes(static_cast<size_t>(size));
    if (reader->failed()) return Truncated();
    if (absl::Status status = ParseAttribute(name, type, value, header); !status.ok())
      return status;
  }
  for (const char* needed :
       {"channels", "dataWindow", "displayWindow", "compression", "lineOrder"}) {
    if (!header->types.contains(needed)) {
      return Malformed(absl::StrCat("attribute \"", needed, "\" is missing"));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<ExrFileHeader> ScanExrHeader(std::string_view bytes) {
  ByteReader reader(bytes);
  if (reader.TakeBytes(kMagic.size()) != kMagic) return Malformed("the magic number is missing");
  const auto version = reader.Take<uint32_t>();
  if (reader.failed()) return Truncated();
  constexpr uint32_t kKnownFlags = kTiledFlag | kLongNamesFlag | kDeepFlag | kPartsFlag;
  if ((version & 0xff) != kVersion || (version & ~(0xff | kKnownFlags)) != 0) {
    return Malformed("an unknown version or feature");
  }
  ExrFileHeader file;
  file.deep = (version & kDeepFlag) != 0;
  while (true) {
    ExrHeader header;
    if (absl::Status status = ParseHeader(&reader, &header); !status.ok()) return status;
    if ((version & kTiledFlag) != 0 && header.tile_pixels == 0)
      return Malformed("tiles of no size");
    file.parts.push_back(std::move(header));
    if ((version & kPartsFlag) == 0) return file;
    if (file.parts.size() > kPartsMax) return Malformed("too many parts");
    // An empty header ends the list.
    ByteReader ahead = reader;
    if (ahead.Take<char>() == '\0')
      return ahead.failed() ? absl::StatusOr<ExrFileHeader>(Truncated()) : file;
  }
}

absl::StatusOr<std::optional<ExrFileHeader>> ReadExrHeader(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string read;
  absl::StatusOr<ExrFileHeader> header = absl::DataLossError("");
  for (size_t size = 1 << 14; absl::IsDataLoss(header.status()) && size <= kExrHeaderBytesMax;
       size *= 16) {
    const size_t had = read.size();
    read.resize(size);
    file.read(read.data() + had, static_cast<std::streamsize>(size - had));
    read.resize(had + static_cast<size_t>(file.gcount()));
    if (!read.starts_with(kMagic)) return std::nullopt;
    header = ScanExrHeader(read);
    if (!file) break;
  }
  if (header.ok()) return *std::move(header);
  const bool longer = absl::IsDataLoss(header.status()) && file.good();
  return absl::InvalidArgumentError(
      absl::StrCat(path, ": not a readable image: ",
                   longer ? absl::StrCat("its header has more than ", kExrHeaderBytesMax, " bytes")
                          : std::string(header.status().message())));
}

}  // namespace sheaf
