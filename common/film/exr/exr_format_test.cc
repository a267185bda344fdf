// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Formats, attributes and channel names of images' files.
#include "common/film/exr/exr_format.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <random>
#include <set>

#include "common/exr/exr_header_scan.h"
#include "common/film/exr/exr_channels.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/exr/resumed_image.h"

namespace sheaf {
namespace {

using ::testing::HasSubstr;

FilmOutputs AllOutputs() {
  FilmOutputs outputs;
  for (size_t i = 0; i < kAovCount; ++i) outputs.Add(static_cast<Aov>(i));
  for (size_t i = 0; i < kIdKindCount; ++i) {
    outputs.AddIdNumber(static_cast<IdKind>(i));
    outputs.AddCryptomatte(static_cast<IdKind>(i));
  }
  outputs.light_groups = {"default", "key_1"};
  return outputs;
}

// Smooth colors, as DWA is made for, and noise in all other channels.
FrameImage MakeImage() {
  FrameImage image = MakeFrameImage({3, 5, 67, 45}, 80, 60, AllOutputs());
  std::mt19937 random(5);
  std::normal_distribution<float> value(0, 1000);
  for (size_t i = 0; i < image.planes.size(); ++i) {
    const bool is_color = IsColorChannel(image.channel_names[i]);
    for (size_t p = 0; p < image.planes[i].size(); ++p) {
      image.planes[i][p] = is_color ? 0.1f + static_cast<float>(p) * 0x1p-12f : value(random);
    }
  }
  image.metadata = {{"frameNumber", "24"}, {"relativeMse", "0.0125"}, {"sceneDigest", "c"}};
  image.attributes = {{"software", "Sheaf"},
                      {"cryptomatte/abc/name", "CryptoObject"},
                      {"cryptomatte/abc/manifest", "{}"}};
  return image;
}

void ExpectSameImage(const FrameImage& read, const FrameImage& image) {
  EXPECT_EQ(ImageDigest(read), ImageDigest(image));
  EXPECT_EQ(read.metadata, image.metadata);
  EXPECT_EQ(read.attributes, image.attributes);
}

TEST(ExrFormatTest, FormatsWithoutLossKeepEveryBit) {
  const FrameImage image = MakeImage();
  for (const ExrCompression compression : {ExrCompression::kUncompressed, ExrCompression::kZip,
                                           ExrCompression::kZips, ExrCompression::kPiz}) {
    for (const ExrParts parts : {ExrParts::kSingle, ExrParts::kMulti}) {
      for (const int32_t tile_size_px : {0, 16}) {
        const ExrFormat format{ExrType::kFloat, compression, parts, tile_size_px};
        ASSERT_TRUE(CheckExrFormat(format).ok());
        const absl::StatusOr<FrameImage> read = DecodeFrameImage(EncodeFrameImage(image, format));
        ASSERT_TRUE(read.ok()) << ExrCompressionName(compression) << read.status();
        ExpectSameImage(*read, image);
      }
    }
  }
  EXPECT_EQ(EncodeFrameImage(image, {}), EncodeFrameImage(image));
}

TEST(ExrFormatTest, HalfRoundsColorsOnly) {
  FrameImage image = MakeImage();
  (*image.Find("G"))[7] = 1e6f;
  (*image.Find("key_1.B"))[8] = -1e30f;
  EXPECT_EQ(CountBeyondHalf(image), 2);
  const absl::StatusOr<FrameImage> read =
      DecodeFrameImage(EncodeFrameImage(image, {.type = ExrType::kHalf}));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->metadata.at(kRoundingKey), "half");
  EXPECT_EQ((*read->Find("G"))[7], 65504);
  EXPECT_EQ((*read->Find("key_1.B"))[8], -65504);
  for (size_t i = 0; i < image.planes.size(); ++i) {
    const std::string& name = image.channel_names[i];
    ASSERT_NE(read->Find(name), nullptr) << name;
    if (!IsColorChannel(name)) {
      EXPECT_EQ(*read->Find(name), image.planes[i]) << name;
      continue;
    }
    EXPECT_NE(*read->Find(name), image.planes[i]) << name;
    EXPECT_NEAR((*read->Find(name))[100], image.planes[i][100], 0x1p-11 * image.planes[i][100]);
  }
  EXPECT_TRUE(IsColorChannel("denoised.R") && IsColorChannel("denoised_external.R"));
  EXPECT_FALSE(IsColorChannel("denoisedError.R")) << "an error, as those of stderr";
}

TEST(ExrFormatTest, ErrorsAndCountsOfTheLightLayerAreNoColors) {
  EXPECT_TRUE(IsColorChannel("light.mean.R"));
  EXPECT_TRUE(IsColorChannel("light.group.key.B"));
  EXPECT_FALSE(IsColorChannel("light.stderr.R"));
  for (const std::string name : {"light.samples", "light.nonfinite"}) {
    EXPECT_FALSE(IsColorChannel(name));
    EXPECT_EQ(FileChannelName(name), name + ".X");
    EXPECT_EQ(ImageChannelName(name + ".X"), name);
  }
}

TEST(ExrFormatTest, DwaLeavesDataAlone) {
  const FrameImage image = MakeImage();
  for (const ExrCompression compression : {ExrCompression::kDwaa, ExrCompression::kDwab}) {
    const absl::StatusOr<FrameImage> read =
        DecodeFrameImage(EncodeFrameImage(image, {.compression = compression}));
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_EQ(read->metadata.at(kRoundingKey), ExrCompressionName(compression));
    for (size_t i = 0; i < image.planes.size(); ++i) {
      const std::string& name = image.channel_names[i];
      ASSERT_NE(read->Find(name), nullptr) << name;
      if (!IsColorChannel(name)) {
        EXPECT_EQ(*read->Find(name), image.planes[i]) << name;
      } else {
        EXPECT_NEAR((*read->Find(name))[100], image.planes[i][100], 0.02) << name;
      }
    }
    EXPECT_FALSE(CheckExrFormat({.compression = compression, .parts = ExrParts::kSingle}).ok());
  }
}

TEST(ExrFormatTest, SeveralPartsAreLayers) {
  const std::string bytes = EncodeFrameImage(MakeImage(), {.parts = ExrParts::kMulti});
  const absl::StatusOr<ExrFileHeader> file = ScanExrHeader(bytes);
  ASSERT_TRUE(file.ok()) << file.status();
  std::set<std::string> names;
  for (const ExrHeader& part : file->parts) {
    const std::string& name = part.strings.at("name");
    names.insert(name);
    for (const ExrChannel& channel : part.channels) {
      EXPECT_EQ(LayerOfChannel(ImageChannelName(channel.name)), name);
    }
    const bool is_of_objects = name.starts_with("CryptoObject");
    EXPECT_EQ(part.strings.contains("cryptomatte/abc/manifest"), is_of_objects || name == "rgba");
  }
  EXPECT_EQ(file->parts[0].strings.at("name"), "rgba");
  EXPECT_EQ(names.size(), file->parts.size());
  for (const char* name : {"depth", "uv", "samples", "CryptoObject00", "rest.CryptoAsset"}) {
    EXPECT_TRUE(names.contains(name)) << name;
  }
}

// Blender 3.4 takes the last component for the channel within a layer.
TEST(ExrFormatTest, EveryChannelHasAComponentOfOneLetter) {
  std::set<std::string> names;
  for (const std::string& name : MakeImage().channel_names) {
    const std::string in_file = FileChannelName(name);
    EXPECT_EQ(in_file.substr(in_file.rfind('.') + 1).size(), 1u) << in_file;
    EXPECT_EQ(ImageChannelName(in_file), name);
    EXPECT_TRUE(names.insert(in_file).second) << in_file;
  }
  EXPECT_EQ(ImageChannelName("samples"), "samples");
  EXPECT_EQ(ImageChannelName("beauty.X"), "beauty.X");
}

TEST(ExrFormatTest, AttributesHaveTheirTypes) {
  FrameImage image = MakeImage();
  const std::string matrix = "1 0 0 0 0 0.100000001 0 0 0 0 1 0 -3 0 2.5 1";
  image.metadata = {
      {"frameNumber", "-3"},  {"relativeMse", "1.25e-05"}, {"seed", "2147483648"},
      {"size", "80x60"},      {"window", "3,5,67,45"},     {"whiteBalanceK", "5000"},
      {"errorCurve", "16 1"}, {"depthMax", "many"},        {"denoisedMse", "0.00552758"}};
  image.attributes = {{"framesPerSecond", "24000/1001"},
                      {"worldToCamera", matrix},
                      {"worldToNDC", "1 2"},
                      {"owner", "anna"},
                      {"comments", "two\nlines"},
                      {"utcOffset", "0"}};
  const std::string bytes = EncodeFrameImage(image);
  const absl::StatusOr<FrameImage> read = DecodeFrameImage(bytes);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->metadata, image.metadata);
  EXPECT_EQ(read->attributes, image.attributes);
  const absl::StatusOr<ExrFileHeader> file = ScanExrHeader(bytes);
  for (const auto& [name, type] :
       {std::pair("sheaf:frameNumber", "int"), std::pair("sheaf:relativeMse", "float"),
        std::pair("sheaf:seed", "string"), std::pair("sheaf:size", "v2i"),
        std::pair("sheaf:window", "box2i"), std::pair("sheaf:whiteBalanceK", "float"),
        std::pair("sheaf:errorCurve", "string"), std::pair("sheaf:depthMax", "string"),
        std::pair("sheaf:denoisedMse", "float"), std::pair("framesPerSecond", "rational"),
        std::pair("worldToCamera", "m44f"), std::pair("worldToNDC", "string"),
        std::pair("owner", "string")}) {
    EXPECT_EQ(file->parts[0].types.at(name), type) << name;
  }
}

// The field of view of other programs is that of worldToNDC, in each part.
TEST(ExrFormatTest, TheScreenWindowIsThatOfTheCamera) {
  const auto screen_window = [](const std::string& to_camera, const std::string& to_ndc) {
    FrameImage image = MakeImage();
    if (!to_camera.empty()) image.attributes["worldToCamera"] = to_camera;
    if (!to_ndc.empty()) image.attributes["worldToNDC"] = to_ndc;
    const absl::StatusOr<ExrFileHeader> file =
        ScanExrHeader(EncodeFrameImage(image, {.parts = ExrParts::kMulti}));
    std::set<float> widths;
    for (const ExrHeader& part : file->parts) {
      float width = 0;
      std::memcpy(&width, part.numbers.at("screenWindowWidth").data(), sizeof width);
      widths.insert(width);
    }
    EXPECT_EQ(widths.size(), 1U);
    return *widths.begin();
  };
  // A camera at 1000, 20, 3 that looks along -x: its x axis is z, and its frame 1.5 by 1 wide.
  const std::string to_camera = "0 0 -1 0 0 1 0 0 1 0 0 0 -3 -20 1000 1";
  const std::string perspective = "-0.5 -0.5 0 -1 0 -1 0 0 0.666666687 0 0 0 498 520 0 1000";
  EXPECT_NEAR(screen_window(to_camera, perspective), 1.5, 1e-6);
  EXPECT_EQ(screen_window("", ""), 1);
  EXPECT_EQ(screen_window(to_camera, ""), 1);
  EXPECT_EQ(screen_window("1 2", perspective), 1);
  const std::string orthographic = "1 0 0 0 0 -1 0 0 0 0 1 0 0.5 0.5 0 1";
  EXPECT_EQ(screen_window("1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", orthographic), 1);
}

TEST(ExrFormatTest, RoundedImagesCannotBeResumed) {
  FrameImage image = MakeFrameImage({0, 0, 4, 4}, 4, 4);
  std::ranges::fill(*image.Find("R"), 0.1f);
  image.metadata = {{kFrameDigestKey, "f"}, {kImageDigestKey, ImageDigest(image)}};
  FrameImage read = *DecodeFrameImage(EncodeFrameImage(image, {.type = ExrType::kHalf}));
  const auto resumed = ResumedImage::Make(std::move(read), {}, {});
  EXPECT_THAT(std::string(resumed.status().message()), HasSubstr("--exr-type float"));
}

TEST(ExrFormatTest, SizesOfAllPartsCount) {
  const std::string bytes = EncodeFrameImage(MakeImage(), {.parts = ExrParts::kMulti});
  const int64_t image_bytes = 64 * 40 * 4 * static_cast<int64_t>(MakeImage().planes.size());
  EXPECT_TRUE(DecodeFrameImage(bytes, image_bytes).ok());
  EXPECT_TRUE(absl::IsResourceExhausted(DecodeFrameImage(bytes, image_bytes - 1).status()));
}

TEST(ExrFormatTest, DamagedFilesOfSeveralPartsAreErrors) {
  const std::string bytes =
      EncodeFrameImage(MakeFrameImage({0, 0, 8, 8}, 8, 8), {.parts = ExrParts::kMulti});
  for (size_t size = 0; size < bytes.size(); size += 1 + size / 20) {
    EXPECT_FALSE(DecodeFrameImage(std::string_view(bytes).substr(0, size)).ok()) << size;
  }
}

}  // namespace
}  // namespace sheaf
