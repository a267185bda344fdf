// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The readers of lights (ReadImage) and of surfaces (TextureCache) take a file for the same image.
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "common/image/image_io.h"
#include "common/image/texture_cache.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/support/image_files.h"
#include "tests/support/temporary_path.h"

namespace sheaf {
namespace {

using testing::BigEndian;
using ::testing::ElementsAre;
using testing::ExrBytes;
using testing::ExrText;
using ::testing::HasSubstr;
using testing::PngBytes;
using ::testing::StartsWith;
using testing::TemporaryPath;

std::string Written(const std::string& name, const std::string& bytes) {
  const std::string path = TemporaryPath(name);
  std::ofstream(path, std::ios::binary) << bytes;
  return path;
}

// The channels of a pixel, by both readers; those of alpha only by the texture's.
struct Read {
  std::vector<float> light, surface;
};
absl::StatusOr<Read> ReadPixel(const std::string& path, int x = 0, int y = 0) {
  const absl::StatusOr<FloatImage> image = ReadImage(path);
  TextureCache cache(uint64_t{1} << 20);
  const absl::StatusOr<TextureImage> texture = cache.Open(path, {});
  EXPECT_EQ(image.status().code(), texture.status().code()) << texture.status();
  EXPECT_EQ(image.status().message(), texture.status().message());
  if (!image.ok()) return image.status();
  EXPECT_EQ(image->width, texture->width);
  EXPECT_EQ(image->height, texture->height);
  EXPECT_EQ(image->chromaticities, texture->chromaticities);
  Read read;
  for (int c = 0; c < image->channels; ++c) read.light.push_back(image->At(x, y, c));
  const TexelIndex where[] = {{x, y}};
  Texel texel[1];
  cache.ReadTexels(texture->index, where, texel);
  read.surface.assign(texel[0].begin(), texel[0].begin() + texture->channels);
  return read;
}

TEST(ImageChannelsTest, ExrChannelsAreTakenByName) {
  const std::vector<std::pair<std::map<std::string, float>, std::vector<float>>> kinds{
      {{{"R", 1}, {"G", 2}, {"B", 3}}, {1, 2, 3}},
      {{{"R", 1}, {"G", 2}, {"B", 3}, {"A", .5f}, {"Z", 9}, {"C", 8}}, {1, 2, 3, .5f}},
      {{{"red", 1}, {"green", 2}, {"blue", 3}}, {1, 2, 3}},
      {{{"Y", .3f}, {"A", 1}, {"Z", 5}}, {.3f}},
      {{{"Y", .3f}, {"A", .5f}}, {.3f}},
      {{{"height", .7f}}, {.7f}},
      {{{"Combined.R", 1}, {"Combined.G", 2}, {"Combined.B", 3}, {"Depth.Z", 9}}, {1, 2, 3}},
      {{{"R", 1}, {"G", 2}, {"B", 3}, {"x.R", 4}, {"x.G", 5}, {"x.B", 6}}, {1, 2, 3}}};
  for (const auto& [channels, expected] : kinds) {
    const auto read = ReadPixel(Written("named.exr", ExrBytes({.channels = channels})));
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_EQ(read->surface, expected);
    EXPECT_EQ(read->light,
              std::vector<float>(expected.begin(),
                                 expected.begin() + std::min<ptrdiff_t>(expected.size(), 3)));
  }
}

TEST(ImageChannelsTest, ExrChannelsWithoutAMeaningAreRefused) {
  std::map<std::string, float> spectral;
  for (int nm = 400; nm < 700; nm += 25) spectral["S0." + std::to_string(nm) + ",5nm"] = 1;
  for (const std::map<std::string, float>& channels :
       {spectral,
        {{"Z", 1}, {"A", 1}},
        {{"R", 1}, {"G", 1}},
        {{"Y", 1}, {"RY", 1}, {"BY", 1}},
        {{"a.R", 1}, {"a.G", 1}, {"a.B", 1}, {"b.R", 1}, {"b.G", 1}, {"b.B", 1}}}) {
    const std::string path = Written("meaningless.exr", ExrBytes({.channels = channels}));
    const absl::Status status = ReadPixel(path).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    const std::string message(status.message());
    EXPECT_THAT(message, StartsWith(path + ": its channels are "));
    EXPECT_THAT(message, HasSubstr(channels.begin()->first));
    EXPECT_EQ(message.find('\n'), std::string::npos);
  }
}

TEST(ImageChannelsTest, AlphaOfOneEverywhereIsDropped) {
  const auto rgba = [](int alpha) {
    return std::string{"\x10\x20\x30\xff\x10\x20\x30", 7} + static_cast<char>(alpha);
  };
  for (const auto& [alpha, channels] : {std::pair{255, 3u}, std::pair{254, 4u}}) {
    const auto read = ReadPixel(Written("alpha.png", PngBytes(2, 1, 8, 6, rgba(alpha))));
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_EQ(read->surface.size(), channels);
  }
  for (const auto& [alpha, channels] : {std::pair{0xffffu, 3u}, std::pair{0xfffeu, 4u}}) {
    const std::string texel = BigEndian(0x1111, 2) + BigEndian(0x2222, 2) + BigEndian(0x3333, 2);
    const auto read =
        ReadPixel(Written("alpha16.png", PngBytes(1, 1, 16, 6, texel + BigEndian(alpha, 2))));
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_EQ(read->surface.size(), channels);
  }
  for (const auto& [alpha, channels] : {std::pair{1.f, 3u}, std::pair{2.f, 4u}}) {
    const auto read = ReadPixel(
        Written("alpha.exr", ExrBytes({.channels = {{"R", 1}, {"G", 1}, {"B", 1}, {"A", alpha}}})));
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_EQ(read->surface.size(), channels);
  }
}

TEST(ImageChannelsTest, IntegersOfAnyWidthAreSrgb) {
  const std::string texel = BigEndian(32896, 2);  // 128 / 255.
  for (const auto& bytes : {PngBytes(1, 1, 16, 0, texel), PngBytes(1, 1, 8, 0, "\x80")}) {
    const auto read = ReadPixel(Written("srgb.png", bytes));
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_THAT(read->surface, ElementsAre(::testing::FloatNear(0.21586f, 1e-5f)));
    EXPECT_THAT(read->light, ElementsAre(::testing::FloatNear(0.21586f, 1e-5f)));
  }
}

TEST(ImageChannelsTest, GrayWithAlphaIsGray) {
  const auto read = ReadPixel(Written("gray.png", PngBytes(1, 1, 8, 4, std::string("\xff\x80"))));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_THAT(read->surface, ElementsAre(1));
  EXPECT_THAT(read->light, ElementsAre(1));
}

TEST(ImageChannelsTest, ChromaticitiesAreThoseOfTheHeader) {
  const std::array<float, 8> ap1{.713f, .293f, .165f, .83f, .128f, .044f, .32168f, .33767f};
  const std::string path = Written(
      "ap1.exr", ExrBytes({.channels = {{"R", 1}, {"G", 1}, {"B", 1}}, .chromaticities = ap1}));
  ASSERT_TRUE(ReadPixel(path).ok());
  EXPECT_EQ(ReadImage(path)->chromaticities, ap1);
}

// The display window is the image. Pixels stored beyond it are not seen, and those it lacks are
// black and transparent.
TEST(ImageChannelsTest, TheDisplayWindowIsTheImage) {
  ExrText exr;
  exr.channels = {{"R", 1}, {"G", 2}, {"B", 3}, {"A", 1}};
  exr.width = 3;
  exr.height = 2;
  exr.x = -1;
  exr.y = 4;
  exr.display = {0, 2, 3, 4};
  const std::string path = Written("display.exr", ExrBytes(exr));
  const absl::StatusOr<FloatImage> image = ReadImage(path);
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_EQ(image->width, 4);
  EXPECT_EQ(image->height, 3);
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 4; ++x) {
      const auto read = ReadPixel(path, x, y);
      ASSERT_TRUE(read.ok()) << read.status();
      const bool is_stored = y == 2 && x < 2;
      EXPECT_EQ(read->light, is_stored ? (std::vector<float>{1, 2, 3}) : std::vector<float>(3));
      EXPECT_EQ(read->surface,
                is_stored ? (std::vector<float>{1, 2, 3, 1}) : std::vector<float>(4));
    }
  }
  exr.width = 6;
  exr.height = 5;
  exr.y = 1;
  exr.channels = {{"R", 1}, {"G", 2}, {"B", 3}};
  EXPECT_EQ(ReadImage(Written("beyond.exr", ExrBytes(exr)))->pixels.size(), size_t{4 * 3 * 3});
  exr.display = {100, 100, 103, 102};
  const absl::Status apart = ReadPixel(Written("apart.exr", ExrBytes(exr))).status();
  EXPECT_THAT(std::string(apart.message()), HasSubstr("stores no pixel of its display window"));
}

}  // namespace
}  // namespace sheaf
