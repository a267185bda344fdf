// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/texture_cache.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <vector>

#include "common/image/image_io.h"
#include "gtest/gtest.h"

namespace sheaf {
namespace {

std::string TemporaryTexturePath(const std::string& name) {
  const std::filesystem::path directory =
      std::filesystem::path(::testing::TempDir()) / "sheaf_texture_cache_test";
  std::filesystem::create_directories(directory);
  return (directory / name).string();
}

// Every pixel is different; larger than a few tiles.
std::string WritePattern(const std::string& name, int size) {
  std::vector<Rgb8> pixels;
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      pixels.push_back({static_cast<uint8_t>(x), static_cast<uint8_t>(y),
                        static_cast<uint8_t>((x * 31 + y * 17) % 256)});
    }
  }
  const std::string path = TemporaryTexturePath(name);
  EXPECT_TRUE(WritePng(path, size, size, pixels).ok());
  return path;
}

TEST(TextureCacheTest, EightBitTexelsUseTheRequestedEncoding) {
  const std::string path = WritePattern("encoding.png", 256);
  TextureCache cache(uint64_t{16} << 20);
  const TexelIndex where[] = {{0, 0}, {128, 0}, {255, 77}};
  Texel values[3];

  absl::StatusOr<TextureImage> image = cache.Open(path, {});
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_EQ(image->channels, 3);
  cache.ReadTexels(image->index, where, values);
  EXPECT_EQ(values[0][0], 0);
  EXPECT_EQ(values[1][0], DecodeSrgb(128 / 255.0f));
  EXPECT_EQ(values[2][0], 1);
  EXPECT_EQ(values[2][1], DecodeSrgb(77 / 255.0f));

  image = cache.Open(path, {TexelEncoding::Kind::kLinear});
  ASSERT_TRUE(image.ok());
  cache.ReadTexels(image->index, where, values);
  EXPECT_EQ(values[1][0], 128 / 255.0f);

  image = cache.Open(path, {TexelEncoding::Kind::kGamma, 2});
  ASSERT_TRUE(image.ok());
  cache.ReadTexels(image->index, where, values);
  EXPECT_FLOAT_EQ(values[1][0], (128 / 255.0f) * (128 / 255.0f));
}

TEST(TextureCacheTest, NamesAreNoOptionsAndNoPatterns) {
  for (const char* name : {"a?b=1.png", "<UDIM>.png", "%(UDIM)d.png", "what?.png"}) {
    const std::string path = WritePattern(name, 64);
    TextureCache cache(uint64_t{16} << 20);
    const absl::StatusOr<TextureImage> image = cache.Open(path, {});
    ASSERT_TRUE(image.ok()) << image.status();
    const TexelIndex where[] = {{63, 7}};
    Texel values[1];
    cache.ReadTexels(image->index, where, values);
    EXPECT_EQ(values[0][0], DecodeSrgb(63 / 255.0f)) << name;
    EXPECT_EQ(values[0][1], DecodeSrgb(7 / 255.0f)) << name;
    const absl::StatusOr<FloatImage> whole = ReadImage(path);
    ASSERT_TRUE(whole.ok()) << whole.status();
    EXPECT_EQ(whole->width, 64) << name;
  }
}

TEST(TextureCacheTest, ValuesDoNotDependOnTheCacheState) {
  const int size = 512;
  const std::string path = WritePattern("eviction.png", size);
  TextureCache large(uint64_t{64} << 20), tiny(1);  // 1: the minimum that the library accepts.
  const absl::StatusOr<TextureImage> in_large = large.Open(path, {});
  const absl::StatusOr<TextureImage> in_tiny = tiny.Open(path, {});
  ASSERT_TRUE(in_large.ok() && in_tiny.ok());
  uint32_t state = 1;
  for (int i = 0; i < 300; ++i) {
    TexelIndex where[4];
    for (TexelIndex& texel : where) {
      state = state * 1664525u + 1013904223u;
      texel = {static_cast<int>((state >> 8) % size), static_cast<int>((state >> 20) % size)};
    }
    Texel a[4], b[4];
    large.ReadTexels(in_large->index, where, a);
    tiny.ReadTexels(in_tiny->index, where, b);
    for (int k = 0; k < 4; ++k) EXPECT_EQ(a[k], b[k]);
  }
}

TEST(TextureCacheTest, M10NonFiniteTexelsAreCountedAndReadAsZero) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  const std::vector<float> values = {1, 2, 3, nan, 5, 6, 7, infinity, 9, 10, 11, 12};
  const std::string path = TemporaryTexturePath("nan.pfm");
  std::ofstream(path, std::ios::binary)
      .write("PF\n4 1\n-1.0\n", 12)
      .write(reinterpret_cast<const char*>(values.data()),
             static_cast<std::streamsize>(values.size() * sizeof(float)));
  TextureCache cache(uint64_t{1} << 20);
  const absl::StatusOr<TextureImage> image = cache.Open(path, {});
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_EQ(image->non_finite_texels, 2u);
  const TexelIndex where[] = {{0, 0}, {1, 0}, {2, 0}, {3, 0}};
  Texel texels[4];
  cache.ReadTexels(image->index, where, texels);
  EXPECT_EQ(texels[0], (Texel{1, 2, 3, 0}));
  EXPECT_EQ(texels[1], (Texel{0, 5, 6, 0}));
  EXPECT_EQ(texels[2], (Texel{7, 0, 9, 0}));
  EXPECT_EQ(texels[3], (Texel{10, 11, 12, 0}));
}

TEST(TextureCacheTest, OpeningDetectsDamage) {
  const std::string whole = WritePattern("whole.png", 256);
  const std::string cut = TemporaryTexturePath("cut.png");
  std::filesystem::copy_file(whole, cut, std::filesystem::copy_options::overwrite_existing);
  std::filesystem::resize_file(cut, std::filesystem::file_size(cut) / 2);
  TextureCache cache(uint64_t{16} << 20);
  const absl::Status status = cache.Open(cut, {}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(std::string(status.message()).rfind(cut, 0), 0u) << status;
  EXPECT_EQ(cache.Open(TemporaryTexturePath("absent.png"), {}).status().code(),
            absl::StatusCode::kNotFound);
}

}  // namespace
}  // namespace sheaf
