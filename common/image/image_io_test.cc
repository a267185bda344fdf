// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/image_io.h"

#include <cmath>
#include <fstream>
#include <limits>

#include "common/base/file.h"
#include "gtest/gtest.h"
#include "tests/support/temporary_path.h"

namespace sheaf {
namespace {

using testing::TemporaryPath;

// A 2 x 1 PFM file, for testing float formats: no encoder between file and reader.
void WritePfm(const std::string& path, const std::vector<float>& values, size_t values_written) {
  std::ofstream file(path, std::ios::binary);
  file << "PF\n2 1\n-1.0\n";
  file.write(reinterpret_cast<const char*>(values.data()),
             static_cast<std::streamsize>(values_written * sizeof(float)));
}

TEST(ImageIoTest, PngRoundTripsEveryByte) {
  std::vector<Rgb8> pixels;
  for (int i = 0; i < 16 * 16; ++i) {
    pixels.push_back({static_cast<uint8_t>(i), static_cast<uint8_t>(255 - i),
                      static_cast<uint8_t>(i * 7 % 256)});
  }
  const std::string path = TemporaryPath("bytes.png");
  ASSERT_TRUE(WritePng(path, 16, 16, pixels).ok());
  const absl::StatusOr<FloatImage> image = ReadImage(path);
  ASSERT_TRUE(image.ok()) << image.status();
  ASSERT_EQ(image->width, 16);
  ASSERT_EQ(image->channels, 3);
  for (int i = 0; i < 16 * 16; ++i) {
    EXPECT_EQ(EncodeSrgb8(image->At(i % 16, i / 16, 0)), pixels[i].r);
    EXPECT_EQ(EncodeSrgb8(image->At(i % 16, i / 16, 1)), pixels[i].g);
    EXPECT_EQ(EncodeSrgb8(image->At(i % 16, i / 16, 2)), pixels[i].b);
  }
}

TEST(ImageIoTest, EncodedPngEqualsTheWrittenFile) {
  const std::vector<Rgb8> pixels(6, Rgb8{1, 2, 3});
  const absl::StatusOr<std::string> bytes = EncodePng(3, 2, pixels);
  ASSERT_TRUE(bytes.ok());
  EXPECT_EQ(bytes->substr(1, 3), "PNG");
  ASSERT_TRUE(WritePng(TemporaryPath("same.png"), 3, 2, pixels).ok());
  EXPECT_EQ(*ReadWholeFile(TemporaryPath("same.png")), *bytes);
}

TEST(ImageIoTest, FloatValuesRoundTrip) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  WritePfm(TemporaryPath("float.pfm"), {1e6f, -2.5f, 1e-20f, nan, 0, 0.1f}, 6);
  const absl::StatusOr<FloatImage> image = ReadImage(TemporaryPath("float.pfm"));
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_EQ(image->At(0, 0, 0), 1e6f);
  EXPECT_EQ(image->At(0, 0, 1), -2.5f);
  EXPECT_EQ(image->At(0, 0, 2), 1e-20f);
  EXPECT_TRUE(std::isnan(image->At(1, 0, 0)));
  EXPECT_EQ(image->At(1, 0, 2), 0.1f);
}

TEST(ImageIoTest, ErrorsNameThePath) {
  const std::string text = TemporaryPath("text.png");
  std::ofstream(text) << "this is no image";
  const absl::StatusOr<std::string> whole =
      EncodePng(64, 64, std::vector<Rgb8>(64 * 64, Rgb8{200, 100, 50}));
  const std::string cut = TemporaryPath("cut.png");
  std::ofstream(cut, std::ios::binary) << whole->substr(0, whole->size() / 2);
  const std::string cut_pfm = TemporaryPath("cut.pfm");
  WritePfm(cut_pfm, {1, 2, 3, 4, 5, 6}, 3);
  for (const std::string& path : {text, cut, cut_pfm}) {
    const absl::StatusOr<FloatImage> image = ReadImage(path);
    EXPECT_EQ(image.status().code(), absl::StatusCode::kInvalidArgument) << path;
    EXPECT_EQ(std::string(image.status().message()).rfind(path, 0), 0u) << image.status();
  }
  EXPECT_EQ(ReadImage(TemporaryPath("absent.png")).status().code(), absl::StatusCode::kNotFound);
}

TEST(ImageIoTest, ImagesAreCheckedAsTheyAreRead) {
  const std::string path = TemporaryPath("checked");
  const std::string png = *EncodePng(64, 64, std::vector<Rgb8>(64 * 64, Rgb8{9, 8, 7}));
  for (const std::string& bytes : {png, png.substr(0, png.size() / 2), std::string("no image")}) {
    std::ofstream(path + ".png", std::ios::binary) << bytes;
    const absl::Status read = ReadImage(path + ".png").status();
    EXPECT_EQ(CheckImage(path + ".png"), read);
    EXPECT_EQ(read.ok(), bytes == png);
  }
  std::ofstream(path + ".png", std::ios::binary) << png.substr(0, png.size() / 2);
  EXPECT_TRUE(CheckImage(path + ".png", {.whole_pixels_max = 64 * 64 - 1}).ok()) << "the header";
  EXPECT_FALSE(CheckImage(path + ".png", {.side_max = 63}).ok());
  EXPECT_TRUE(absl::IsNotFound(CheckImage(path + ".exr")));
}

// The library takes the memory first, and then finds the end of the file.
TEST(ImageIoTest, ChunksOfPngLieWithinTheFile) {
  constexpr size_t kAfterHeader = 33;
  std::string bytes = *EncodePng(1, 1, std::vector<Rgb8>(1));
  bytes.insert(kAfterHeader, std::string("\x7f\0\0\0tEXt", 8));
  const std::string path = TemporaryPath("claims.png");
  std::ofstream(path, std::ios::binary) << bytes;
  EXPECT_NE(ReadImage(path).status().message().find("a chunk at byte 33 claims 2130706432 bytes"),
            std::string::npos)
      << ReadImage(path).status();
}

TEST(ImageIoTest, OnlyHeadersOfLargeImagesAreReadOnRequest) {
  std::vector<Rgb8> pixels(64 * 64);
  for (size_t i = 0; i < pixels.size(); ++i) pixels[i].r = static_cast<uint8_t>(i * i * 37 >> 3);
  const std::string whole = *EncodePng(64, 64, pixels);
  const std::string cut = TemporaryPath("cut header.png");
  std::ofstream(cut, std::ios::binary) << whole.substr(0, whole.size() / 2);
  const absl::StatusOr<FloatImage> header = ReadImage(cut, {.whole_pixels_max = 64 * 64 - 1});
  ASSERT_TRUE(header.ok()) << header.status();
  EXPECT_EQ(header->width, 64);
  EXPECT_TRUE(header->pixels.empty());
  EXPECT_FALSE(ReadImage(cut, {.whole_pixels_max = 64 * 64}).ok());
}

TEST(ImageIoTest, ImagesBeyondTheLimitAreRefusedBeforeReading) {
  const std::string path = TemporaryPath("large.png");
  ASSERT_TRUE(WritePng(path, 32, 32, std::vector<Rgb8>(32 * 32)).ok());
  ReadImageLimits limits;
  limits.memory_bytes_max = 32 * 32 * 3 * sizeof(float) - 1;
  EXPECT_EQ(ReadImage(path, limits).status().code(), absl::StatusCode::kResourceExhausted);
  limits.memory_bytes_max += 1;
  EXPECT_TRUE(ReadImage(path, limits).ok());
}

TEST(ImageIoTest, SrgbTransferMatchesTheStandard) {
  EXPECT_EQ(EncodeSrgb(0), 0);
  EXPECT_EQ(EncodeSrgb(1), 1);
  EXPECT_EQ(EncodeSrgb(std::numeric_limits<float>::quiet_NaN()), 0);
  EXPECT_EQ(EncodeSrgb(std::numeric_limits<float>::infinity()), 1);
  EXPECT_NEAR(EncodeSrgb(0.18f), 0.4613561f, 1e-6f);
  EXPECT_NEAR(DecodeSrgb(0.5f), 0.2140411f, 1e-6f);
  EXPECT_EQ(EncodeSrgb8(0.18f), 118);
  for (int level = 0; level < 256; ++level) {
    EXPECT_EQ(EncodeSrgb8(DecodeSrgb(static_cast<float>(level) / 255)), level);
  }
}

}  // namespace
}  // namespace sheaf
