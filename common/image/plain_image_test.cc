// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The readers of usual formats give the bits that OpenImageIO gives, and leave all else to it.
#include "common/image/plain_image.h"

#include <ImfChannelList.h>
#include <ImfCompression.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <ImfTiledOutputFile.h>
#include <png.h>

#include <bit>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <random>
#include <tuple>

#include <jpeglib.h>

#include "common/base/file.h"
#include "common/image/image_header.h"
#include "common/image/image_library.h"
#include "gtest/gtest.h"
#include "tests/support/image_files.h"
#include "tests/support/temporary_path.h"

namespace sheaf {
namespace {

using testing::LittleEndian;
using testing::RawBytes;
using testing::TemporaryPath;

constexpr int kWidth = 37, kHeight = 23;

std::string Random(size_t size) {
  std::mt19937 random(static_cast<uint32_t>(size));
  std::string bytes;
  for (size_t i = 0; i < size; ++i) bytes.push_back(static_cast<char>(random() >> 8));
  return bytes;
}
std::string Saved(const std::string& name, const std::string& bytes) {
  const std::string path = TemporaryPath(name);
  std::ofstream(path, std::ios::binary) << bytes;
  return path;
}

// Numbers are equal, or both are not numbers.
bool IsSame(float a, float b) {
  return std::bit_cast<uint32_t>(a) == std::bit_cast<uint32_t>(b) ||
         (std::isnan(a) && std::isnan(b));
}

// Expects that both readers of images and both of textures agree in every number. taken: whether
// the file is one that is read without the library.
void ExpectAgreement(const std::string& path, bool taken) {
  SCOPED_TRACE(path);
  ASSERT_TRUE(CheckImageHeader(path).ok());
  EXPECT_EQ(ReadPlainImage(path).has_value(), taken);
  EXPECT_EQ(ReadPlainImage(path, {.is_header_enough = true}).has_value(), taken);
  const absl::StatusOr<const ImageLibrary*> library = LoadImageLibrary();
  ASSERT_TRUE(library.ok()) << library.status();
  const absl::StatusOr<FloatImage> image = ReadImage(path), other = (*library)->read(path, {});
  ASSERT_TRUE(image.ok() && other.ok()) << image.status() << other.status();
  EXPECT_EQ(image->width, other->width);
  EXPECT_EQ(image->height, other->height);
  EXPECT_EQ(image->channels, other->channels);
  EXPECT_EQ(image->chromaticities, other->chromaticities);
  ASSERT_EQ(image->pixels.size(), other->pixels.size());
  for (size_t i = 0; i < image->pixels.size(); ++i) {
    ASSERT_TRUE(IsSame(image->pixels[i], other->pixels[i])) << i << ": " << image->pixels[i];
  }
  constexpr uint64_t kCacheBytes = uint64_t{64} << 20;
  for (const TexelEncoding encoding : {TexelEncoding{}, TexelEncoding{TexelEncoding::Kind::kLinear},
                                       TexelEncoding{TexelEncoding::Kind::kGamma, 2.2f}}) {
    TextureCache cache(kCacheBytes);
    const std::unique_ptr<TextureTiles> tiles =
        (*library)->make_texture_tiles(kCacheBytes, [](std::string_view) {});
    const auto a = cache.Open(path, encoding), b = tiles->Open(path, encoding);
    ASSERT_TRUE(a.ok() && b.ok()) << a.status() << b.status();
    EXPECT_EQ(std::tie(a->width, a->height, a->channels, a->non_finite_texels, a->chromaticities),
              std::tie(b->width, b->height, b->channels, b->non_finite_texels, b->chromaticities));
    for (int y = 0; y < a->height; ++y) {
      for (int x = 0; x < a->width; ++x) {
        const TexelIndex where[] = {{x, y}};
        Texel u[1], v[1];
        cache.ReadTexels(a->index, where, u);
        tiles->ReadTexels(b->index, where, v);
        ASSERT_EQ(u[0], v[0]) << x << " " << y;
      }
    }
  }
}

struct PngKind {
  int color_type, depth;
  bool is_interlaced = false, has_transparency = false;
};
std::string WritePngOf(const PngKind& kind, const std::string& name) {
  const std::string path = TemporaryPath(name);
  std::FILE* file = std::fopen(path.c_str(), "wb");
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_init_io(png, file);
  png_set_IHDR(png, info, kWidth, kHeight, kind.depth, kind.color_type,
               kind.is_interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_color palette[256];
  for (int i = 0; i < 256; ++i) {
    palette[i] = {static_cast<png_byte>(i), static_cast<png_byte>(255 - i),
                  static_cast<png_byte>(7 * i)};
  }
  const bool has_palette = kind.color_type == PNG_COLOR_TYPE_PALETTE;
  if (has_palette) png_set_PLTE(png, info, palette, 1 << kind.depth);
  png_byte alphas[2] = {0, 128};
  png_color_16 transparent{};
  transparent.gray = 1;
  if (kind.has_transparency) png_set_tRNS(png, info, alphas, has_palette ? 2 : 0, &transparent);
  png_write_info(png, info);
  const size_t row_bytes = png_get_rowbytes(png, info);
  std::string bytes = Random(row_bytes * kHeight);
  std::vector<png_bytep> rows;
  for (size_t y = 0; y < kHeight; ++y) {
    rows.push_back(reinterpret_cast<png_bytep>(bytes.data()) + y * row_bytes);
  }
  png_write_image(png, rows.data());
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
  std::fclose(file);
  return path;
}

TEST(PlainImageTest, PngOfEveryKind) {
  int number = 0;
  for (const auto& [color_type, depths] :
       std::vector<std::pair<int, std::vector<int>>>{{PNG_COLOR_TYPE_GRAY, {1, 2, 4, 8, 16}},
                                                     {PNG_COLOR_TYPE_PALETTE, {1, 2, 4, 8}},
                                                     {PNG_COLOR_TYPE_RGB, {8, 16}},
                                                     {PNG_COLOR_TYPE_GRAY_ALPHA, {8, 16}},
                                                     {PNG_COLOR_TYPE_RGB_ALPHA, {8, 16}}}) {
    for (const int depth : depths) {
      for (const bool is_interlaced : {false, true}) {
        for (const bool has_transparency : {false, true}) {
          if (has_transparency && (color_type & PNG_COLOR_MASK_ALPHA) != 0) continue;
          ExpectAgreement(WritePngOf({color_type, depth, is_interlaced, has_transparency},
                                     "kind" + std::to_string(number++) + ".png"),
                          true);
        }
      }
    }
  }
}

std::string WriteJpegOf(int channels, bool is_progressive, int sampling, const std::string& name) {
  const std::string path = TemporaryPath(name);
  std::FILE* file = std::fopen(path.c_str(), "wb");
  jpeg_compress_struct jpeg{};
  jpeg_error_mgr errors{};
  jpeg.err = jpeg_std_error(&errors);
  jpeg_create_compress(&jpeg);
  jpeg_stdio_dest(&jpeg, file);
  jpeg.image_width = kWidth;
  jpeg.image_height = kHeight;
  jpeg.input_components = channels;
  jpeg.in_color_space = channels == 1 ? JCS_GRAYSCALE : channels == 3 ? JCS_RGB : JCS_CMYK;
  jpeg_set_defaults(&jpeg);
  if (channels == 3) jpeg.comp_info[0].h_samp_factor = jpeg.comp_info[0].v_samp_factor = sampling;
  if (is_progressive) jpeg_simple_progression(&jpeg);
  jpeg_start_compress(&jpeg, TRUE);
  std::string bytes = Random(static_cast<size_t>(kWidth * channels * kHeight));
  while (jpeg.next_scanline < jpeg.image_height) {
    auto* row = reinterpret_cast<JSAMPROW>(&bytes[jpeg.next_scanline * kWidth * channels]);
    jpeg_write_scanlines(&jpeg, &row, 1);
  }
  jpeg_finish_compress(&jpeg);
  jpeg_destroy_compress(&jpeg);
  std::fclose(file);
  return path;
}

TEST(PlainImageTest, JpegOfEveryKind) {
  for (const bool is_progressive : {false, true}) {
    ExpectAgreement(WriteJpegOf(1, is_progressive, 1, "gray.jpg"), true);
    ExpectAgreement(WriteJpegOf(3, is_progressive, 1, "full.jpg"), true);
    ExpectAgreement(WriteJpegOf(3, is_progressive, 2, "quarter.jpg"), true);
  }
  ExpectAgreement(WriteJpegOf(4, false, 1, "cmyk.jpg"), false);
}

TEST(PlainImageTest, PfmOfEitherOrder) {
  for (const int channels : {1, 3}) {
    for (const char* scale : {"-1.0", "1.0", "-1", "1.000000"}) {
      const std::string head =
          std::string(channels == 1 ? "Pf" : "PF") + "\n37 23\n" + scale + "\n";
      // Random bits are numbers of every size, infinities and no numbers.
      const std::string path =
          Saved("order.pfm", head + Random(sizeof(float) * kWidth * kHeight * channels));
      ExpectAgreement(path, true);
    }
  }
  const std::string numbers = Random(sizeof(float) * kWidth * kHeight * 3);
  EXPECT_FALSE(ReadPlainImage(Saved("scaled.pfm", "PF\n37 23\n-2.0\n" + numbers)).has_value());
  EXPECT_FALSE(ReadPlainImage(Saved("comment.pfm", "PF\n# a\n37 23\n-1\n" + numbers)).has_value());
  EXPECT_FALSE(
      ReadPlainImage(Saved("short.pfm", "PF\n37 23\n-1\n" + numbers.substr(1))).has_value());
}

std::string TgaBytes(int type, int depth, int descriptor, const std::string& name,
                     const std::string& pixels) {
  std::string bytes(18, '\0');
  bytes[0] = static_cast<char>(name.size());
  bytes[2] = static_cast<char>(type);
  bytes.replace(12, 4, LittleEndian(kWidth, 2) + LittleEndian(kHeight, 2));
  bytes[16] = static_cast<char>(depth);
  bytes[17] = static_cast<char>(descriptor);
  return bytes + name + pixels;
}
// Packets of runs and of single pixels that fill the image.
std::string TgaRuns(size_t pixel_bytes) {
  std::string bytes;
  for (int left = kWidth * kHeight, i = 0; left > 0; ++i) {
    const int count = std::min(left, 1 + i * 37 % 128);
    const bool repeats = i % 3 != 0;
    bytes.push_back(static_cast<char>((repeats ? 0x80 : 0) | (count - 1)));
    bytes += Random(pixel_bytes * static_cast<size_t>(repeats ? 1 : count));
    left -= count;
  }
  return bytes;
}

TEST(PlainImageTest, TgaOfTheUsualKinds) {
  for (const int descriptor : {0, 0x20}) {
    for (const size_t pixel : {size_t{1}, size_t{3}}) {
      const int type = pixel == 1 ? 3 : 2, depth = static_cast<int>(8 * pixel);
      const std::string name = "tga" + std::to_string(descriptor) + std::to_string(pixel);
      ExpectAgreement(Saved(name + ".tga", TgaBytes(type, depth, descriptor, "a name",
                                                    Random(pixel * kWidth * kHeight))),
                      true);
      ExpectAgreement(
          Saved(name + "runs.tga", TgaBytes(type + 8, depth, descriptor, "", TgaRuns(pixel))),
          true);
    }
  }
  // With alpha, and with rows from the right.
  ExpectAgreement(Saved("alpha.tga", TgaBytes(2, 32, 8, "", Random(4 * kWidth * kHeight))), false);
  EXPECT_FALSE(ReadPlainImage(Saved("cut.tga", TgaBytes(2, 24, 0, "", Random(99)))).has_value());
}

// The channels of `names`, of one type, in a data window that begins at (x, y).
std::string WriteExrOf(const std::vector<std::string>& names, Imf::PixelType type,
                       Imf::Compression compression, bool is_tiled, int x,
                       const std::string& name) {
  const std::string path = TemporaryPath(name);
  const Imath::Box2i window(Imath::V2i(x, 2 * x), Imath::V2i(x + kWidth - 1, 2 * x + kHeight - 1));
  Imf::Header header(window, window);
  header.compression() = compression;
  const size_t number = type == Imf::HALF ? 2 : 4, row = number * kWidth;
  std::vector<std::string> planes;
  Imf::FrameBuffer frame;
  for (const std::string& channel : names) {
    header.channels().insert(channel, Imf::Channel(type));
    planes.push_back(Random(row * kHeight + planes.size()));
  }
  for (size_t c = 0; c < names.size(); ++c) {
    char* begin = planes[c].data() - x * static_cast<std::ptrdiff_t>(number) -
                  2 * x * static_cast<std::ptrdiff_t>(row);
    frame.insert(names[c], Imf::Slice(type, begin, number, row));
  }
  if (is_tiled) {
    header.setTileDescription(Imf::TileDescription(16, 16, Imf::ONE_LEVEL));
    Imf::TiledOutputFile file(path.c_str(), header, 0);
    file.setFrameBuffer(frame);
    file.writeTiles(0, file.numXTiles() - 1, 0, file.numYTiles() - 1);
  } else {
    Imf::OutputFile file(path.c_str(), header, 0);
    file.setFrameBuffer(frame);
    file.writePixels(kHeight);
  }
  return path;
}

TEST(PlainImageTest, ExrOfTheUsualKinds) {
  int number = 0;
  const auto name = [&] { return "kind" + std::to_string(number++) + ".exr"; };
  for (const auto& channels : std::vector<std::vector<std::string>>{
           {"Y"}, {"R", "G", "B"}, {"R", "G", "B", "A"}, {"a.R", "a.G", "a.B", "Z"}, {"height"}}) {
    for (const Imf::PixelType type : {Imf::HALF, Imf::FLOAT}) {
      for (const bool is_tiled : {false, true}) {
        ExpectAgreement(WriteExrOf(channels, type, Imf::ZIP_COMPRESSION, is_tiled, 0, name()),
                        true);
      }
    }
  }
  ExpectAgreement(WriteExrOf({"R", "G", "B"}, Imf::HALF, Imf::PIZ_COMPRESSION, false, -5, name()),
                  true);
  ExpectAgreement(WriteExrOf({"R", "G", "B"}, Imf::FLOAT, Imf::NO_COMPRESSION, true, 9, name()),
                  true);
  testing::ExrText part{.width = 4, .height = 3, .channels = {{"R", 1}, {"G", 2}, {"B", 3}}};
  part.chromaticities = {.7347f, .2653f, 0, 1, 1e-4f, -.077f, .32168f, .33767f};
  ExpectAgreement(Saved("primaries.exr", testing::ExrBytes(part)), true);
  part.display = {-1, -1, 4, 4};
  ExpectAgreement(Saved("window.exr", testing::ExrBytes(part)), false);
}

TEST(PlainImageTest, LargeImagesAreLeftToTheLibrary) {
  const std::string path = WritePngOf({PNG_COLOR_TYPE_RGB, 8}, "large.png");
  EXPECT_TRUE(ReadPlainImage(path, {.bytes_max = 3 * kWidth * kHeight}).has_value());
  EXPECT_FALSE(ReadPlainImage(path, {.bytes_max = 3 * kWidth * kHeight - 1}).has_value());
}

// Files that are cut or altered are read as the library reads them, or refused in its words.
TEST(PlainImageTest, DamagedFilesEndAsByTheLibrary) {
  const absl::StatusOr<const ImageLibrary*> library = LoadImageLibrary();
  ASSERT_TRUE(library.ok()) << library.status();
  const std::vector<std::string> whole = {
      WritePngOf({PNG_COLOR_TYPE_RGB, 8}, "whole.png"), WriteJpegOf(3, false, 2, "whole.jpg"),
      WriteExrOf({"R", "G", "B"}, Imf::HALF, Imf::ZIP_COMPRESSION, false, 0, "whole.exr"),
      Saved("whole.tga", TgaBytes(10, 24, 0, "", TgaRuns(3))),
      Saved("whole.pfm", "PF\n37 23\n-1\n" + Random(4 * kWidth * kHeight * 3))};
  std::mt19937 random(1);
  int read = 0, refused = 0;
  for (const std::string& path : whole) {
    const std::string bytes = *ReadWholeFile(path);
    for (int i = 0; i < 60; ++i) {
      std::string altered = bytes.substr(0, i % 3 == 0 ? random() % bytes.size() : bytes.size());
      if (altered.empty()) continue;
      if (i % 3 != 0) {
        char& byte = altered[random() % std::min<size_t>(altered.size(), 2000)];
        byte = static_cast<char>(byte ^ (1 << random() % 8));
      }
      const std::string changed = Saved("altered" + path.substr(path.rfind('.')), altered);
      if (!CheckImageHeader(changed).ok()) continue;
      const absl::StatusOr<FloatImage> image = ReadImage(changed),
                                       other = (*library)->read(changed, {});
      ASSERT_EQ(image.ok(), other.ok())
          << path << " " << i << " " << image.status() << other.status();
      ++(image.ok() ? read : refused);
      if (!image.ok()) continue;
      ASSERT_EQ(image->pixels.size(), other->pixels.size()) << path << " " << i;
      for (size_t k = 0; k < image->pixels.size(); ++k) {
        ASSERT_TRUE(IsSame(image->pixels[k], other->pixels[k])) << path << " " << i << " " << k;
      }
    }
  }
  EXPECT_GT(read, 50);
  EXPECT_GT(refused, 50);
}

}  // namespace
}  // namespace sheaf
