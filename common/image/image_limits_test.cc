// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/image_limits.h"

#include <sys/resource.h>

#include <fstream>
#include <map>
#include <string>

#include "common/image/image_io.h"
#include "common/image/texture_cache.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/support/image_files.h"
#include "tests/support/temporary_path.h"

namespace sheaf {
namespace {

using namespace std::string_literals;
using testing::BigEndian;
using testing::ExrBytes;
using testing::LittleEndian;
using testing::PngBytes;
using ::testing::StartsWith;
using testing::TemporaryPath;

constexpr uint32_t kColumns = 80'000'000;
constexpr size_t kMemoryMax = size_t{512} << 20;

std::string ExrOf(int32_t width, int32_t height, std::array<uint32_t, 2> tile = {}) {
  return ExrBytes({.width = width,
                   .height = height,
                   .channels = {{"B", 0}, {"G", 0}, {"R", 0}},
                   .tile = tile,
                   .header_only = true});
}

std::string TiffOf(uint32_t width, uint32_t height, uint32_t tile = 0) {
  std::map<uint64_t, uint64_t> tags{{256, width}, {257, height}, {258, 8},
                                    {259, 1},     {262, 1},      {277, 1}};
  if (tile > 0) {
    tags.insert({{322, tile}, {323, 16}, {324, 8}, {325, 100}});
  } else {
    tags.insert({{273, 8}, {278, height}, {279, 100}});
  }
  std::string bytes = "II*\0"s + LittleEndian(8, 4) + LittleEndian(tags.size(), 2);
  for (const auto& [tag, value] : tags) {
    bytes +=
        LittleEndian(tag, 2) + LittleEndian(4, 2) + LittleEndian(1, 4) + LittleEndian(value, 4);
  }
  return bytes + std::string(200, '\0');
}

std::string BmpOf(uint32_t width) {
  return "BM" + LittleEndian(1000, 4) + LittleEndian(0, 4) + LittleEndian(54, 4) +
         LittleEndian(40, 4) + LittleEndian(width, 4) + LittleEndian(1, 4) + LittleEndian(1, 2) +
         LittleEndian(24, 2) + std::string(88, '\0');
}

// type: 2, or 10 with run lengths.
std::string TgaOf(char type) {
  return "\0\0"s + type + std::string(9, '\0') + "\xff\xff\xff\xff\x20\x00"s +
         std::string(64, '\0');
}

std::string DdsOf(uint32_t width) {
  std::string bytes = "DDS " + LittleEndian(124, 4) + LittleEndian(0x1007, 4) + LittleEndian(1, 4) +
                      LittleEndian(width, 4) + std::string(56, '\0');
  for (const uint32_t word :
       {32u, 0x41u, 0u, 32u, 0xff0000u, 0xff00u, 0xffu, 0xff000000u, 0x1000u}) {
    bytes += LittleEndian(word, 4);
  }
  return bytes + std::string(80, '\0');
}

std::string FitsOf(uint32_t width) {
  std::string bytes;
  for (const std::string& card :
       {"SIMPLE  =                    T"s, "BITPIX  =                    8"s,
        "NAXIS   =                    2"s, "NAXIS1  =             "s + std::to_string(width),
        "NAXIS2  =                    1"s, "END"s}) {
    bytes += card + std::string(80 - card.size(), ' ');
  }
  return bytes + std::string(5760 - bytes.size(), ' ');
}

std::string DpxOf(uint32_t width) {
  std::string bytes(2112, '\0');
  bytes.replace(0, 8, "SDPX" + BigEndian(2048, 4));
  bytes.replace(8, 4, "V1.0");
  bytes.replace(768, 12, BigEndian(0, 2) + BigEndian(1, 2) + BigEndian(width, 4) + BigEndian(1, 4));
  bytes[800] = 50;                            // RGB
  bytes[803] = 8;                             // of 8 bits,
  bytes.replace(808, 4, BigEndian(2048, 4));  // which begin here.
  return bytes;
}

std::string PsdOf(uint32_t width) {
  return "8BPS" + BigEndian(1, 2) + std::string(6, '\0') + BigEndian(3, 2) + BigEndian(1, 4) +
         BigEndian(width, 4) + BigEndian(8, 2) + BigEndian(3, 2) + std::string(80, '\0');
}

std::string CodestreamOf(uint32_t width, uint32_t height) {
  std::string bytes = "\xff\x4f\xff\x51" + BigEndian(47, 2) + BigEndian(0, 2);
  for (const uint32_t number : {width, height, 0u, 0u, width, height, 0u, 0u}) {
    bytes += BigEndian(number, 4);
  }
  return bytes + BigEndian(3, 2) + "\7\1\1\7\1\1\7\1\1" + std::string(64, '\0');
}
std::string Jp2Of(const std::string& codestream) {
  return "\0\0\0\x0cjP  \r\n\x87\n"s + BigEndian(20, 4) + "ftypjp2 \0\0\0\0jp2 "s +
         BigEndian(0, 4) + "jp2c" + codestream;
}

std::string GifOf(uint32_t width, uint32_t height) {
  return "GIF89a" + LittleEndian(width, 2) + LittleEndian(height, 2) + std::string(64, '\0');
}

std::string JpegOf(uint32_t width, uint32_t height) {
  return "\xff\xd8\xff\xc0"s + BigEndian(11, 2) + "\x08"s + BigEndian(height, 2) +
         BigEndian(width, 2) + "\x01\x01\x11\x00"s + std::string(64, '\0');
}

// Each claims 80 million columns, or as many as its format can.
std::map<std::string, std::string> LargeHeaders() {
  const std::string columns = std::to_string(kColumns);
  return {
      {"lines.exr", ExrOf(kColumns, 1)},
      {"high.exr", ExrOf(1, kColumns)},
      {"tiles.exr", ExrOf(kColumns, 64, {64, 64})},
      {"tile.exr", ExrOf(64, 64, {kColumns, 1})},
      {"display.exr",
       ExrBytes({.display = {0, 0, kColumns, 0}, .channels = {{"Y", 1}}, .header_only = true})},
      {"strips.tif", TiffOf(kColumns, 64)},
      {"tile.tif", TiffOf(64, 64, kColumns)},
      {"wide.png", PngBytes(kColumns, 1, 8, 0, "x")},
      {"both.png", PngBytes(1'000'000, 60'000, 8, 0, "")},
      {"both.jpg", JpegOf(65535, 65535)},
      {"wide.hdr",
       "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X " + columns + "\n" + std::string(64, '\0')},
      {"wide.pfm", "PF\n" + columns + " 1\n-1.0\n" + std::string(64, '\0')},
      {"wide.ppm", "P6\n" + columns + " 1\n255\n" + std::string(64, '\0')},
      {"text.ppm", "P3\n" + columns + " 1\n255\n1 1 1"},
      {"wide.bmp", BmpOf(kColumns)},
      {"both.tga", TgaOf(2)},
      {"runs.tga", TgaOf(10)},
      {"wide.dds", DdsOf(kColumns)},
      {"wide.fits", FitsOf(kColumns)},
      {"wide.dpx", DpxOf(kColumns)},
      {"wide.psd", PsdOf(kColumns)},
      {"wide.j2c", CodestreamOf(kColumns, 1)},
      {"wide.jp2", Jp2Of(CodestreamOf(kColumns, 1))},
      {"both.jp2", Jp2Of(CodestreamOf(100'000, 100'000))},
      {"both.gif", GifOf(65535, 65535)},
  };
}

// While it lives, the process may take only this much more address space.
class MemoryLimit {
 public:
  MemoryLimit() {
    getrlimit(RLIMIT_AS, &before_);
    size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    rlimit limit = before_;
    limit.rlim_cur = pages * 4096 + kMemoryMax;
    setrlimit(RLIMIT_AS, &limit);
  }
  ~MemoryLimit() { setrlimit(RLIMIT_AS, &before_); }
  MemoryLimit(const MemoryLimit&) = delete;
  MemoryLimit& operator=(const MemoryLimit&) = delete;

 private:
  rlimit before_{};
};

void ExpectRefusal(const absl::Status& status, const std::string& path) {
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << path << status;
  const std::string message(status.message());
  EXPECT_THAT(message, StartsWith(path + ": "));
  EXPECT_EQ(message.find('\n'), std::string::npos) << message;
}

TEST(ImageLimitsTest, HeadersThatClaim80MillionColumnsAreRefusedBeforeMemoryIsTaken) {
  TextureCache cache(uint64_t{16} << 20);
  const std::string small = TemporaryPath("small.png");
  std::ofstream(small, std::ios::binary) << PngBytes(1, 1, 8, 0, "x");
  ASSERT_TRUE(ReadImage(small).ok() && cache.Open(small, {}).ok());  // Loads the library.
  for (const auto& [name, bytes] : LargeHeaders()) {
    const std::string path = TemporaryPath(name);
    std::ofstream(path, std::ios::binary) << bytes;
#ifndef __SANITIZE_ADDRESS__  // Which takes all address space.
    const MemoryLimit limit;
#endif
    ExpectRefusal(ReadImage(path).status(), path);
    ExpectRefusal(cache.Open(path, {}).status(), path);
  }
}

TEST(ImageLimitsTest, EachNumberHasALimit) {
  const ImageClaim fits{.width = 1 << 17, .height = 1 << 15, .channels = 4};
  EXPECT_TRUE(CheckImageClaim("a.exr", fits).ok());
  for (const ImageClaim& claim :
       {ImageClaim{.width = (1 << 17) + 1}, ImageClaim{.height = (1 << 17) + 1},
        ImageClaim{.width = 1 << 17, .height = (1 << 15) + 1}, ImageClaim{.channels = 1025},
        ImageClaim{.width = 1 << 17, .channels = 9}, ImageClaim{.tile_pixels = (1 << 24) + 1},
        ImageClaim{.channels = 2, .tile_pixels = (1 << 23) + 1}, ImageClaim{.width = 0},
        ImageClaim{.height = -1}, ImageClaim{.tile_pixels = int64_t{1} << 62},
        ImageClaim{.width = 1 << 15, .height = 1 << 14, .channels = 3, .is_read_whole = true}}) {
    const absl::Status status = CheckImageClaim("a.exr", claim);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(status.message()), StartsWith("a.exr: its header claims "));
  }
  EXPECT_FALSE(CheckImageClaim("a.exr", {.width = 8193}, kLightImageSideMax).ok());
}

}  // namespace
}  // namespace sheaf
