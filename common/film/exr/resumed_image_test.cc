// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/exr/resumed_image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "common/film/error/flip_estimate.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/film.h"
#include "common/film/film_test_samples.h"
#include "common/film/light/light_image.h"
#include "common/film/light/light_pass_accumulator.h"
#include "common/film/tile_tree.h"

namespace sheaf {
namespace {

using ::testing::HasSubstr;

constexpr PixelRect kWindow{3, 5, 27, 21};
constexpr PixelRect kTile{3, 5, 19, 21};

FilmSample SampleAt(int32_t x, int32_t y, uint64_t n) {
  FilmSample sample = MakeTestSample(x, y, n);
  sample.filter_weight = 1;
  for (float* v : {&sample.radiance.r, &sample.radiance.g, &sample.radiance.b}) {
    *v = std::fmod(*v, 4.0f) + 0.1f;
  }
  return sample;
}

FilmTile Render(const PixelRect& rect, SampleBlock block) {
  FilmTile tile(rect, block);
  PixelAccumulator accumulator(&tile);
  for (int32_t y = rect.y0; y < rect.y1; ++y) {
    for (int32_t x = rect.x0; x < rect.x1; ++x) {
      accumulator.Begin(x, y);
      for (uint64_t n = block.first; n < block.End(); ++n) {
        FilmSample sample = SampleAt(x, y, n);
        if (x == 4 && n == 9) sample.radiance.r = std::numeric_limits<float>::quiet_NaN();
        accumulator.Add(n, sample);
      }
      accumulator.End();
    }
  }
  return tile;
}

FilmTile Merge(const PixelRect& rect, std::vector<FilmTile> parts, uint64_t first, uint64_t end) {
  TileTree tree(rect);
  for (FilmTile& part : parts) EXPECT_TRUE(tree.Insert(std::move(part)).ok());
  for (uint64_t n = first; n < end;) {
    const uint64_t aligned = n == 0 ? std::bit_floor(end) : n & (~n + 1);
    const uint64_t count = std::min(aligned, std::bit_floor(end - n));
    EXPECT_TRUE(tree.Insert(Render(rect, {n, count})).ok());
    n += count;
  }
  return tree.Root();
}

FrameImage Deliver(uint64_t samples, const ImageColor& color = {}) {
  FrameImage image = MakeFrameImage(kWindow, 32, 32, {}, color);
  for (const PixelRect& rect : CutTiles(kWindow, 16)) {
    DevelopTile(Merge(rect, {}, 0, samples), &image);
  }
  image.metadata[kFrameDigestKey] = "f";
  image.metadata[kImageDigestKey] = ImageDigest(image);
  return image;
}

ImageColor WideColor() {
  ImageColor color;
  color.chromaticities = ChromaticitiesOf(Primaries::kAcesCg);
  color.light_from_srgb = *RgbFromRgb(color.chromaticities, Chromaticities());
  color.albedo_from_srgb = color.light_from_srgb;
  return color;
}

TEST(ResumedImageTest, PartsDevelopIntoTheImage) {
  for (const uint64_t samples : {16u, 80u, 100u}) {
    for (const ImageColor& color : {ImageColor(), WideColor()}) {
      const FrameImage image = Deliver(samples, color);
      const auto resumed = ResumedImage::Make(image, {}, color);
      ASSERT_TRUE(resumed.ok()) << resumed.status();
      EXPECT_EQ(*resumed->SamplesOf(kTile), samples);
      FrameImage again = MakeFrameImage(kWindow, 32, 32, {}, color);
      for (const PixelRect& rect : CutTiles(kWindow, 16)) {
        DevelopTile(Merge(rect, resumed->PartsOf(rect), samples, samples), &again);
      }
      for (size_t i = 0; i < image.planes.size(); ++i) {
        for (size_t p = 0; p < image.planes[i].size(); ++p) {
          const float expected = image.planes[i][p];
          ASSERT_NEAR(again.planes[i][p], expected, 1e-5f * (1 + std::fabs(expected)))
              << image.channel_names[i] << " of " << samples;
        }
      }
    }
  }
}

TEST(ResumedImageTest, ResumingMatchesOneRun) {
  const FrameImage first = Deliver(48), whole = Deliver(200);
  const auto resumed = ResumedImage::Make(first, {}, {});
  ASSERT_TRUE(resumed.ok());
  FrameImage second = MakeFrameImage(kWindow, 32, 32);
  ErrorSample error(kWindow);
  for (const PixelRect& rect : CutTiles(kWindow, 16)) {
    const FilmTile sums = Merge(rect, resumed->PartsOf(rect), 48, 200);
    DevelopTile(sums, &second);
    error.DevelopTile(sums, {});
  }
  double variance = 0, whole_variance = 0, sample_square = 0;
  for (size_t i = 0; i < whole.planes.size(); ++i) {
    const std::string& name = whole.channel_names[i];
    for (size_t p = 0; p < whole.planes[i].size(); ++p) {
      const float expected = whole.planes[i][p], found = second.planes[i][p];
      if (!name.starts_with("stderr.")) {
        ASSERT_NEAR(found, expected, 2e-6f * (1 + std::fabs(expected))) << name;
        continue;
      }
      variance += std::pow(double{found}, 2);
      whole_variance += std::pow(double{expected}, 2);
      EXPECT_GT(found, 0.3f * expected);
      EXPECT_LT(found, 2.5f * expected);
    }
  }
  for (const std::vector<float>& plane : error.planes()) {
    for (const float e : plane) sample_square += std::pow(double{e}, 2);
  }
  EXPECT_NEAR(variance / whole_variance, 1, 0.05);
  EXPECT_NEAR(sample_square / variance, 1, 0.15);
}

FilmOutputs GroupsOfLight() {
  FilmOutputs outputs;
  outputs.Add(Aov::kUv);
  outputs.light_groups = {"key", "light"};
  return outputs;
}

// A camera tile with samples in its light groups; and light passes of which some splats are lost.
FilmTile CameraTile(const PixelRect& rect, SampleBlock block) {
  FilmTile tile(rect, block, GroupsOfLight());
  PixelAccumulator accumulator(&tile);
  OutputSample output(tile.outputs());
  for (int32_t y = rect.y0; y < rect.y1; ++y) {
    for (int32_t x = rect.x0; x < rect.x1; ++x) {
      accumulator.Begin(x, y);
      for (uint64_t n = block.first; n < block.End(); ++n) {
        FilmSample sample = SampleAt(x, y, n);
        if (x == 4 && n == 9) sample.radiance.r = std::numeric_limits<float>::quiet_NaN();
        output.means = {0.5f * sample.alpha, 0.25f * sample.alpha, 0, 0, 0, 0, 0, 0};
        const std::array<float, 3> radiance{sample.radiance.r, sample.radiance.g,
                                            sample.radiance.b};
        std::ranges::copy(radiance, output.means.begin() + (n % 2 == 0 ? 2 : 5));
        accumulator.Add(n, sample, output);
      }
      accumulator.End();
    }
  }
  return tile;
}
FilmTile PassesTile(SampleBlock block) {
  FilmTile tile(kWindow, block, GroupsOfLight());
  LightPassAccumulator film(&tile);
  for (uint64_t pass = block.first; pass < block.End(); ++pass) {
    for (int32_t y = kWindow.y0; y < kWindow.y1; ++y) {
      for (int32_t x = kWindow.x0; x < kWindow.x1; ++x) {
        const FilmSample sample = SampleAt(x + 100, y, pass);
        if ((x + y) % 3 == 0) continue;  // Light paths do not reach all pixels.
        film.Add(x, y, sample.radiance, 3, pass % 2);
        if (x == 5) film.Add(x, y, {HUGE_VALF, 0, 0}, 1, 0);
      }
    }
    film.EndPass();
  }
  film.Finish();
  return tile;
}

// Passes in [first, end), each block as long as it may be.
FilmTile MergePasses(std::vector<FilmTile> parts, uint64_t first, uint64_t end) {
  TileTree tree(kWindow);
  for (FilmTile& part : parts) EXPECT_TRUE(tree.Insert(std::move(part)).ok());
  for (uint64_t n = first; n < end; n += 4) EXPECT_TRUE(tree.Insert(PassesTile({n, 4})).ok());
  return tree.Root();
}
FilmTile MergeCamera(std::vector<FilmTile> parts, const PixelRect& rect, uint64_t first,
                     uint64_t end) {
  TileTree tree(rect);
  for (FilmTile& part : parts) EXPECT_TRUE(tree.Insert(std::move(part)).ok());
  for (uint64_t n = first; n < end; n += 4) EXPECT_TRUE(tree.Insert(CameraTile(rect, {n, 4})).ok());
  return tree.Root();
}

// resumed: what it begins with, or null. error: receives the samples of both kinds of path.
FrameImage DeliverLight(const ResumedImage* resumed, uint64_t samples, const ImageColor& color,
                        ErrorSample* error = nullptr) {
  const uint64_t first = resumed == nullptr ? 0 : resumed->light_pass_count();
  FrameImage camera = MakeFrameImage(kWindow, 32, 32, GroupsOfLight(), color), light = camera,
             image = camera;
  ErrorSample of_light(kWindow);
  for (const PixelRect& rect : CutTiles(kWindow, 16)) {
    std::vector<FilmTile> parts;
    if (resumed != nullptr) parts = resumed->PartsOf(rect);
    const FilmTile sums = MergeCamera(std::move(parts), rect, first, samples);
    DevelopTile(sums, &camera);
    if (error != nullptr) error->DevelopTile(sums, color);
  }
  std::vector<FilmTile> parts;
  for (const SampleBlock& block : PrefixBlocks(first)) {
    parts.push_back(resumed->LightPartOf(block));
  }
  const FilmTile sums = MergePasses(std::move(parts), first, samples);
  DevelopTile(sums, &light);
  of_light.DevelopTile(sums, color);
  if (error != nullptr) error->Add(of_light);
  AddLight(camera, light, kWindow, &image);
  SetLightLayer(light, &image);
  image.metadata[kFrameDigestKey] = "f";
  image.metadata[kImageDigestKey] = ImageDigest(image);
  return image;
}

TEST(ResumedImageTest, PartsOfBothKindsOfPathDevelopIntoTheImage) {
  for (const ImageColor& color : {ImageColor(), WideColor()}) {
    const FrameImage image = DeliverLight(nullptr, 48, color);
    const std::string bytes = EncodeFrameImage(image);  // And through a file.
    const auto resumed =
        ResumedImage::Make(*DecodeFrameImage(bytes), GroupsOfLight(), color, /*has_light=*/true);
    ASSERT_TRUE(resumed.ok()) << resumed.status();
    EXPECT_EQ(resumed->light_pass_count(), 48u);
    const FrameImage again = DeliverLight(&*resumed, 48, color);
    ASSERT_EQ(again.channel_names, image.channel_names);
    for (size_t i = 0; i < image.planes.size(); ++i) {
      for (size_t p = 0; p < image.planes[i].size(); ++p) {
        const float expected = image.planes[i][p];
        ASSERT_NEAR(again.planes[i][p], expected, 1e-5f * (1 + std::fabs(expected)))
            << image.channel_names[i];
      }
    }
  }
}

TEST(ResumedImageTest, ResumingBothKindsOfPathMatchesOneRun) {
  const FrameImage first = DeliverLight(nullptr, 32, {}), whole = DeliverLight(nullptr, 80, {});
  const auto resumed = ResumedImage::Make(first, GroupsOfLight(), {}, /*has_light=*/true);
  ASSERT_TRUE(resumed.ok()) << resumed.status();
  ErrorSample error(kWindow);
  const FrameImage second = DeliverLight(&*resumed, 80, {}, &error);
  double variance = 0, whole_variance = 0, sample_square = 0;
  for (size_t i = 0; i < whole.planes.size(); ++i) {
    const std::string& name = whole.channel_names[i];
    for (size_t p = 0; p < whole.planes[i].size(); ++p) {
      const float expected = whole.planes[i][p], found = second.planes[i][p];
      if (name.find("stderr.") == std::string::npos) {
        ASSERT_NEAR(found, expected, 4e-6f * (1 + std::fabs(expected))) << name;
      } else if (name.starts_with("stderr.")) {
        variance += std::pow(double{found}, 2);
        whole_variance += std::pow(double{expected}, 2);
      }
    }
  }
  for (const std::vector<float>& plane : error.planes()) {
    for (const float e : plane) sample_square += std::pow(double{e}, 2);
  }
  EXPECT_NEAR(variance / whole_variance, 1, 0.05);
  EXPECT_NEAR(sample_square / variance, 1, 0.15);  // The noise of both kinds is independent.
}

TEST(ResumedImageTest, LightLayersThatAreBadAreRefused) {
  FrameImage image = DeliverLight(nullptr, 16, {});
  const auto why = [&image] {
    image.metadata[kImageDigestKey] = ImageDigest(image);
    const auto resumed = ResumedImage::Make(image, GroupsOfLight(), {}, /*has_light=*/true);
    return std::string(resumed.status().message());
  };
  EXPECT_EQ(why(), "");
  for (const float passes : {15.0f, 17.0f, HUGE_VALF, std::nanf("")}) {
    image.Find("light.samples")->at(3) = passes;
    EXPECT_THAT(why(), HasSubstr("its light layer contradicts it")) << passes;
  }
  image.Find("light.samples")->at(3) = 16;
  image.Find("light.nonfinite")->at(3) = -1;
  EXPECT_THAT(why(), HasSubstr("contradicts it"));
  image.Find("light.nonfinite")->at(3) = 0;
  image.channel_names.back() = "else.B";
  EXPECT_THAT(why(), HasSubstr("has no channel light.group.light.B"));
  // A frame of the camera alone ignores the layer.
  EXPECT_TRUE(ResumedImage::Make(image, GroupsOfLight(), {}).ok());
}

TEST(ResumedImageTest, ReportsSamplesPerTile) {
  FrameImage image = MakeFrameImage(kWindow, 32, 32);
  const std::vector<PixelRect> tiles = CutTiles(kWindow, 16);
  for (const PixelRect& rect : tiles) {
    DevelopTile(Merge(rect, {}, 0, rect == tiles[0] ? 16 : 48), &image);
  }
  image.metadata = {
      {kFrameDigestKey, "f"}, {kImageDigestKey, ImageDigest(image)}, {"tileSizePx", "16"}};
  const auto resumed = ResumedImage::Make(image, {}, {});
  ASSERT_TRUE(resumed.ok());
  EXPECT_EQ(*resumed->SamplesOf(tiles[0]), 16);
  EXPECT_EQ(*resumed->SamplesOf(tiles[1]), 48);
  const absl::Status other = resumed->SamplesOf(kWindow).status();
  EXPECT_THAT(std::string(other.message()), HasSubstr("--tile-size 16"));
}

TEST(ResumedImageTest, ExplainsWhyAnImageCannotBeResumed) {
  const auto why = [](FrameImage image, const FilmOutputs& outputs = {}) {
    const auto resumed = ResumedImage::Make(std::move(image), outputs, {});
    EXPECT_EQ(resumed.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(resumed.status().message());
  };
  FrameImage image = Deliver(16);
  image.metadata.erase(kImageDigestKey);
  EXPECT_THAT(why(image), HasSubstr("sheaf:imageDigest"));
  image = Deliver(16);
  image.planes[0][7] += 1;
  EXPECT_THAT(why(image), HasSubstr("changed after"));
  image = Deliver(16);
  image.metadata[kSampleWeightKey] = "signed";
  EXPECT_THAT(why(image), HasSubstr("filter is negative"));
  EXPECT_THAT(why(Deliver(8)), HasSubstr("has 8 samples; at least 16"));
  FilmOutputs outputs;
  outputs.AddCryptomatte(IdKind::kObject);
  EXPECT_THAT(why(Deliver(16), outputs), HasSubstr("cryptomattes cannot be continued"));
  outputs = {};
  outputs.Add(Aov::kShadingNormal);
  EXPECT_THAT(why(Deliver(16), outputs), HasSubstr("output Ns.X cannot be continued"));
  outputs = {};
  outputs.Add(Aov::kUv);
  EXPECT_THAT(why(Deliver(16), outputs), HasSubstr("has no channel u"));
}

TEST(ResumedImageTest, PrefixIsCutIntoAlignedBlocks) {
  EXPECT_EQ(PrefixBlocks(100), (std::vector<SampleBlock>{{0, 64}, {64, 32}, {96, 4}}));
  EXPECT_EQ(PrefixBlocks(16), (std::vector<SampleBlock>{{0, 16}}));
}

}  // namespace
}  // namespace sheaf
