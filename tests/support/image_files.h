// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Bytes of image files that no encoder of Sheaf writes: EXR with any channels, windows and
// primaries, and PNG of any depth.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>

namespace sheaf::testing {

inline std::string LittleEndian(uint64_t value, size_t size) {
  std::string bytes;
  for (size_t i = 0; i < size; ++i) bytes.push_back(static_cast<char>(value >> 8 * i));
  return bytes;
}
inline std::string BigEndian(uint64_t value, size_t size) {
  const std::string bytes = LittleEndian(value, size);
  return {bytes.rbegin(), bytes.rend()};
}
template <typename T>
std::string RawBytes(const T& value) {
  return std::string(reinterpret_cast<const char*>(&value), sizeof value);
}

struct ExrText {
  int32_t width = 1, height = 1;            // The size of the data window,
  int32_t x = 0, y = 0;                     // which begins here.
  std::array<int32_t, 4> display{};         // x0, y0, x1, y1, inclusive; all 0: the data window.
  std::map<std::string, float> channels{};  // By name: the value of all its pixels.
  std::optional<std::array<float, 8>> chromaticities{};
  std::array<uint32_t, 2> tile{};  // Width and height; 0: scan lines.
  bool header_only = false;
};

inline std::string ExrBytes(const ExrText& exr) {
  using namespace std::string_literals;
  const auto attribute = [](const std::string& name, const std::string& type,
                            const std::string& value) {
    return name + "\0"s + type + "\0"s + LittleEndian(value.size(), 4) + value;
  };
  const std::array<int32_t, 4> data{exr.x, exr.y, exr.x + exr.width - 1, exr.y + exr.height - 1};
  const bool is_tiled = exr.tile[0] > 0;
  std::string channels;
  for (const auto& [name, value] : exr.channels) {
    channels += name + "\0"s + LittleEndian(2, 4) + LittleEndian(0, 4) + LittleEndian(1, 4) +
                LittleEndian(1, 4);
  }
  std::string bytes =
      "\x76\x2f\x31\x01"s + LittleEndian(is_tiled ? 0x202 : 2, 4) +
      attribute("channels", "chlist", channels + "\0"s) +
      attribute("compression", "compression", "\0"s) +
      attribute("dataWindow", "box2i", RawBytes(data)) +
      attribute("displayWindow", "box2i",
                RawBytes(exr.display == decltype(exr.display){} ? data : exr.display)) +
      attribute("lineOrder", "lineOrder", "\0"s) +
      attribute("pixelAspectRatio", "float", RawBytes(1.0f)) +
      attribute("screenWindowCenter", "v2f", std::string(8, '\0')) +
      attribute("screenWindowWidth", "float", RawBytes(1.0f));
  if (exr.chromaticities) {
    bytes += attribute("chromaticities", "chromaticities", RawBytes(*exr.chromaticities));
  }
  if (is_tiled) bytes += attribute("tiles", "tiledesc", RawBytes(exr.tile) + "\0"s);
  bytes += "\0"s;
  if (exr.header_only) return bytes + std::string(64, '\0');
  std::string line;
  for (const auto& [name, value] : exr.channels) {
    for (int32_t i = 0; i < exr.width; ++i) line += RawBytes(value);
  }
  const size_t table = bytes.size(), rows = static_cast<size_t>(exr.height);
  for (size_t row = 0; row < rows; ++row) {
    bytes += LittleEndian(table + 8 * rows + row * (8 + line.size()), 8);
  }
  for (size_t row = 0; row < rows; ++row) {
    bytes += LittleEndian(static_cast<uint32_t>(exr.y) + row, 4) + LittleEndian(line.size(), 4);
    bytes += line;
  }
  return bytes;
}

// color_type: that of the PNG specification (0 gray, 2 RGB, 4 gray and alpha, 6 RGBA). pixels: as
// stored, at most 60,000 bytes.
inline std::string PngBytes(uint32_t width, uint32_t height, int depth, int color_type,
                            std::string_view pixels) {
  const auto chunk = [](const std::string& type, const std::string& data) {
    uint32_t crc = ~0u;
    for (const char c : type + data) {
      crc ^= static_cast<unsigned char>(c);
      for (int i = 0; i < 8; ++i) crc = crc >> 1 ^ (crc & 1 ? 0xedb88320u : 0);
    }
    return BigEndian(data.size(), 4) + type + data + BigEndian(~crc, 4);
  };
  std::string rows;
  const size_t row_size = pixels.size() / height;
  for (size_t y = 0; y < height; ++y) {
    rows.push_back('\0');  // No filter.
    rows += pixels.substr(y * row_size, row_size);
  }
  uint32_t a = 1, b = 0;
  for (const char c : rows) {
    a = (a + static_cast<unsigned char>(c)) % 65521;
    b = (b + a) % 65521;
  }
  const std::string stored = "\x78\x01\x01" + LittleEndian(rows.size(), 2) +
                             LittleEndian(~rows.size(), 2) + rows + BigEndian(b << 16 | a, 4);
  const std::string header = BigEndian(width, 4) + BigEndian(height, 4) +
                             BigEndian(static_cast<uint64_t>(depth), 1) +
                             BigEndian(static_cast<uint64_t>(color_type), 1) + std::string(3, '\0');
  return "\x89PNG\r\n\x1a\n" + chunk("IHDR", header) + chunk("IDAT", stored) + chunk("IEND", "");
}

}  // namespace sheaf::testing
