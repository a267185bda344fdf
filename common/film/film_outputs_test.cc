// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/film_outputs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "common/film/exr/exr_codec.h"
#include "common/film/film.h"
#include "common/film/film_test_samples.h"
#include "common/film/task_kind.h"

namespace sheaf {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr PixelRect kOutputsRect{3, 5, 8, 9};
constexpr PixelRect kOnePixel{0, 0, 1, 1};

FilmOutputs AllOutputs() {
  FilmOutputs outputs;
  for (size_t i = 0; i < kAovCount; ++i) outputs.Add(static_cast<Aov>(i));
  outputs.light_groups = {"default", "key_1"};
  return outputs;
}

OutputSample MakeTestOutputs(const FilmOutputs& outputs, int32_t x, int32_t y, uint64_t n,
                             float alpha) {
  OutputSample sample(outputs);
  uint64_t key = (static_cast<uint64_t>(x) * 1000 + static_cast<uint64_t>(y)) * 100'000 + n * 50;
  for (float& mean : sample.means) mean = alpha * (HashToUnit(key++) - 0.3f) * 1000;
  return sample;
}

FilmTile MakeTile(const FilmOutputs& outputs, PixelRect rect, SampleBlock block) {
  FilmTile tile(rect, block, outputs);
  PixelAccumulator accumulator(&tile);
  for (int32_t y = rect.y0; y < rect.y1; ++y) {
    for (int32_t x = rect.x0; x < rect.x1; ++x) {
      accumulator.Begin(x, y);
      for (uint64_t n = block.first; n < block.End(); ++n) {
        const FilmSample sample = MakeTestSample(x, y, n);
        accumulator.Add(n, sample, MakeTestOutputs(outputs, x, y, n, sample.alpha));
      }
      accumulator.End();
    }
  }
  return tile;
}

// The first `count` samples of a tile in blocks of random sizes in random order, each encoded and
// decoded as a part.
FilmTile MergeRandomCut(const FilmOutputs& outputs, uint64_t count, std::mt19937* random) {
  std::vector<SampleBlock> blocks;
  for (const SampleBlock& whole : CutSamples(0, count, uint64_t{1} << 40)) {
    const auto cut = [&](const auto& self, SampleBlock block) -> void {
      if (block.count == 1 || (*random)() % 3 == 0) return blocks.push_back(block);
      self(self, {block.first, block.count / 2});
      self(self, {block.first + block.count / 2, block.count / 2});
    };
    cut(cut, whole);
  }
  std::shuffle(blocks.begin(), blocks.end(), *random);
  TileTree tree(kOutputsRect);
  for (const SampleBlock& block : blocks) {
    absl::StatusOr<DecodedPart> part =
        DecodePart(EncodePart(MakeTile(outputs, kOutputsRect, block), {"digest", "profile"}));
    EXPECT_TRUE(part.ok()) << part.status();
    EXPECT_TRUE(tree.Insert(std::move(part->tile)).ok());
  }
  return tree.Root();
}

// Merged along the canonical tree in a single accumulation.
FilmTile MergeWhole(const FilmOutputs& outputs, uint64_t count) {
  TileTree tree(kOutputsRect);
  for (const SampleBlock& block : CutSamples(0, count, uint64_t{1} << 40)) {
    EXPECT_TRUE(tree.Insert(MakeTile(outputs, kOutputsRect, block)).ok());
  }
  return tree.Root();
}

FrameImage Develop(const FilmTile& tile) {
  FrameImage image = MakeFrameImage(tile.rect(), tile.rect().x1, tile.rect().y1, tile.outputs());
  DevelopTile(tile, &image);
  return image;
}

TEST(FilmOutputsTest, AnyPartitionGivesTheSameBits) {
  std::mt19937 random(7);
  for (const uint64_t count : {1u, 16u, 21u, 76u}) {
    const FilmTile whole = MergeWhole(AllOutputs(), count);
    const std::string digest = ImageDigest(Develop(whole));
    for (int i = 0; i < 8; ++i) {
      const FilmTile merged = MergeRandomCut(AllOutputs(), count, &random);
      EXPECT_EQ(merged, whole);
      EXPECT_TRUE(SameBits(merged, whole));
      EXPECT_EQ(ImageDigest(Develop(merged)), digest);
    }
  }
}

// Requesting outputs changes no bit of the image itself.
TEST(FilmOutputsTest, OutputsDoNotChangeTheImage) {
  const FilmTile plain = MakeTestTile(kOutputsRect, {0, 32});
  EXPECT_TRUE(SameBits(MakeTile(AllOutputs(), kOutputsRect, {0, 32}), plain));
  EXPECT_EQ(EncodePart(plain, {}).find("sheaf:outputs"), std::string::npos);
}

TEST(FilmOutputsTest, MeansUseSamplesThatHitASurface) {
  FilmOutputs outputs;
  outputs.Add(Aov::kPosition);
  outputs.Add(Aov::kGeometricNormal);
  FilmTile tile(kOnePixel, {0, 4}, outputs);
  PixelAccumulator accumulator(&tile);
  accumulator.Begin(0, 0);
  const float x[] = {2, 0, 6, 7};
  for (uint64_t n = 0; n < 4; ++n) {
    FilmSample sample;
    sample.alpha = n == 1 ? 0.0f : 1.0f;
    OutputSample extra(outputs);
    if (n != 1) extra.means = {x[n], -1, 1e6f, n == 0 ? 1.0f : 0.0f, n == 0 ? 0.0f : 1.0f, 0};
    accumulator.Add(n, sample, extra);
  }
  accumulator.End();
  const FrameImage image = Develop(tile);
  EXPECT_THAT(*image.Find("P.X"), ElementsAre(5));
  EXPECT_THAT(*image.Find("P.Y"), ElementsAre(-1));
  EXPECT_THAT(*image.Find("P.Z"), ElementsAre(1e6f));
  // The direction of (1, 0, 0) + 2 (0, 1, 0).
  EXPECT_FLOAT_EQ((*image.Find("N.X"))[0], 1 / std::sqrt(5.0f));
  EXPECT_FLOAT_EQ((*image.Find("N.Y"))[0], 2 / std::sqrt(5.0f));
  EXPECT_EQ(image.Find("motion.X"), nullptr);
}

// Positions far from the origin: a float sum of 2^14 of them would lose 14 of their bits.
TEST(FilmOutputsTest, SumsKeepPrecisionOverManySamples) {
  FilmOutputs outputs;
  outputs.Add(Aov::kUv);
  constexpr uint64_t kCount = 1 << 14;
  FilmTile tile(kOnePixel, {0, kCount}, outputs);
  PixelAccumulator accumulator(&tile);
  accumulator.Begin(0, 0);
  double sum = 0;
  for (uint64_t n = 0; n < kCount; ++n) {
    FilmSample sample;
    sample.alpha = 1;
    OutputSample extra(outputs);
    extra.means = {1e6f + HashToUnit(n), 0};
    sum += static_cast<double>(extra.means[0]);
    accumulator.Add(n, sample, extra);
  }
  accumulator.End();
  EXPECT_EQ((*Develop(tile).Find("u"))[0], static_cast<float>(sum / kCount));
}

TEST(FilmOutputsTest, NonFiniteSamplesEnterNoSum) {
  FilmOutputs outputs;
  outputs.Add(Aov::kUv);
  FilmTile tile(kOnePixel, {0, 2}, outputs);
  PixelAccumulator accumulator(&tile);
  accumulator.Begin(0, 0);
  for (uint64_t n = 0; n < 2; ++n) {
    FilmSample sample;
    sample.alpha = 1;
    sample.radiance = Rgb::Gray(1);
    OutputSample extra(outputs);
    extra.means = {0.5f, n == 0 ? 0.25f : std::numeric_limits<float>::quiet_NaN()};
    accumulator.Add(n, sample, extra);
  }
  accumulator.End();
  const FrameImage image = Develop(tile);
  EXPECT_THAT(*image.Find("nonfinite"), ElementsAre(1));
  EXPECT_THAT(*image.Find("samples"), ElementsAre(1));
  EXPECT_THAT(*image.Find("v"), ElementsAre(0.25f));
}

TEST(FilmOutputsTest, ImagesHaveAllCountedChannels) {
  EXPECT_EQ(ImageChannelCount({}), kImageChannelCountMin);
  EXPECT_EQ(ImageChannelCount(AllOutputs()), kImageChannelCountMin + 13 + 6);
}

TEST(FilmOutputsTest, TextRoundTrips) {
  FilmOutputs outputs = AllOutputs();
  outputs.camera_space = true;
  EXPECT_EQ(
      FormatOutputs(outputs),
      "position,normal-geometric,normal-shading,uv,motion,space:camera,light:default,light:key_1");
  EXPECT_EQ(*ParseOutputs(FormatOutputs(outputs)), outputs);
  FilmOutputs of_light = outputs;
  AddMergeBias(&of_light);
  EXPECT_NE(of_light, outputs);
  EXPECT_EQ(*ParseOutputs(FormatOutputs(of_light)), of_light);
  EXPECT_TRUE(ParseOutputs("")->empty());
  for (const char* text : {"uv,position", "uv,uv", "p", ",", "uv,", "UV", "light:",
                           "light:b,light:a", "light:a,light:a", "light:r07", "light:Albedo"}) {
    EXPECT_FALSE(ParseOutputs(text).ok()) << text;
  }
}

TEST(FilmOutputsTest, ParsesCommandLineNames) {
  FilmOutputs outputs;
  ASSERT_TRUE(AddAovs("uv,albedo,position", &outputs).ok());
  EXPECT_EQ(FormatOutputs(outputs), "position,uv");
  const absl::Status status = AddAovs("uvs", &outputs);
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), HasSubstr("normal-geometric"));
}

// A light group also counts samples that hit no surface.
TEST(FilmOutputsTest, LightGroupsAreMeansOverAllSamples) {
  FilmOutputs outputs;
  outputs.light_groups = {"key", "rim"};
  FilmTile tile(kOnePixel, {0, 2}, outputs);
  PixelAccumulator accumulator(&tile);
  accumulator.Begin(0, 0);
  for (uint64_t n = 0; n < 2; ++n) {
    FilmSample sample;
    sample.alpha = n == 0 ? 1.0f : 0.0f;
    OutputSample extra(outputs);
    extra.means = {1, 2, 3, n == 0 ? 0.0f : 5.0f, 0, 0};
    accumulator.Add(n, sample, extra);
  }
  accumulator.End();
  const FrameImage image = Develop(tile);
  EXPECT_THAT(*image.Find("key.G"), ElementsAre(2));
  EXPECT_THAT(*image.Find("rim.R"), ElementsAre(2.5f));
}

TEST(FilmOutputsTest, ParsesLightGroupNames) {
  for (const char* name : {"key", "Key-2", "a_b", "rim"}) EXPECT_EQ(WhyNotLightGroup(name), "");
  for (const std::string name : {"", "a.b", "a,b", "a b", "albedo", "lo", "N", "CryptoObject00"}) {
    EXPECT_NE(WhyNotLightGroup(name), "") << name;
  }
  EXPECT_NE(WhyNotLightGroup(std::string(65, 'a')), "");
  // Longer than the 31 bytes of early EXR files.
  FilmOutputs outputs;
  outputs.light_groups = {std::string(64, 'a')};
  const FilmTile tile = MakeTile(outputs, kOutputsRect, {0, 1});
  const absl::StatusOr<DecodedPart> part = DecodePart(EncodePart(tile, {}));
  ASSERT_TRUE(part.ok()) << part.status();
  EXPECT_EQ(part->tile, tile);
}

TEST(FilmOutputsTest, PartsWithWrongOutputsAreRefused) {
  FilmOutputs outputs;
  outputs.Add(Aov::kUv);
  std::string bytes = EncodePart(MakeTile(outputs, kOutputsRect, {0, 2}), {});
  const size_t at = bytes.find("sheaf:outputs");
  ASSERT_NE(at, std::string::npos);
  const size_t text = bytes.find("uv", at);
  bytes.replace(text, 2, "xv");
  EXPECT_EQ(DecodePart(bytes).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace sheaf
