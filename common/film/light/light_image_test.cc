// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/light/light_image.h"

#include <gtest/gtest.h>

#include <cmath>

#include "common/film/film.h"
#include "common/film/film_test_samples.h"
#include "common/film/light/light_pass_accumulator.h"
#include "common/film/task_kind.h"

namespace sheaf {
namespace {

constexpr PixelRect kWindow{0, 0, 4, 3};

FilmTile LightTile(const FilmOutputs& outputs = {}) {
  FilmTile tile(kWindow, {0, 16}, outputs);
  LightPassAccumulator film(&tile);
  for (int pass = 0; pass < 16; ++pass) {
    for (int32_t x = 0; x < 4; ++x) {
      const float value = HashToUnit(static_cast<uint64_t>(pass * 4 + x));
      film.Add(x, 1, {value, 2 * value, 3 * value}, 1,
               outputs.empty() ? std::nullopt : std::optional<size_t>(0));
    }
    film.EndPass();
  }
  film.Finish();
  return tile;
}

float At(const FrameImage& image, const char* channel, int32_t x, int32_t y) {
  return (*image.Find(channel))[image.window.IndexOf(x, y)];
}

TEST(LightImageTest, MeansAddAndErrorsAddInQuadrature) {
  FrameImage camera = MakeFrameImage(kWindow, 4, 3), light = camera, image = camera;
  DevelopTile(MakeTestTile(kWindow, {0, 32}), &camera);
  DevelopTile(LightTile(), &light);
  AddLight(camera, light, kWindow, &image);
  for (int32_t y = 0; y < 3; ++y) {
    for (int32_t x = 0; x < 4; ++x) {
      for (const char* channel : {"R", "G", "B"}) {
        EXPECT_EQ(At(image, channel, x, y), At(camera, channel, x, y) + At(light, channel, x, y));
      }
      EXPECT_FLOAT_EQ(At(image, "stderr.G", x, y),
                      std::hypot(At(camera, "stderr.G", x, y), At(light, "stderr.G", x, y)));
      for (const char* channel : {"A", "albedo.R", "depth.Z", "samples"}) {
        EXPECT_EQ(At(image, channel, x, y), At(camera, channel, x, y));
      }
    }
  }
  EXPECT_GT(At(light, "stderr.G", 2, 1), 0);
  EXPECT_EQ(At(light, "R", 2, 0), 0);
  EXPECT_EQ(At(image, "stderr.G", 2, 0), At(camera, "stderr.G", 2, 0));
}

TEST(LightImageTest, TheLightLayerIsThatOfLightPathsAlone) {
  FilmOutputs outputs;
  outputs.light_groups = {"key", "light"};  // The group's channels are not those of the layer.
  FrameImage camera = MakeFrameImage(kWindow, 4, 3, outputs), light = camera, image = camera;
  DevelopTile(LightTile(outputs), &light);
  camera.Find("light.R")->assign(12, 0.5f);
  AddLight(camera, light, kWindow, &image);
  const FrameImage before = image;
  for (int i = 0; i < 2; ++i) {  // The second time sets it.
    SetLightLayer(light, &image);
    ASSERT_EQ(image.channel_names.size(), before.channel_names.size() + 8 + 6);
    EXPECT_EQ(*image.Find("light.mean.B"), *light.Find("B"));
    EXPECT_EQ(*image.Find("light.stderr.G"), *light.Find("stderr.G"));
    EXPECT_EQ(*image.Find("light.samples"), std::vector<float>(12, 16));
    EXPECT_EQ(*image.Find("light.nonfinite"), std::vector<float>(12, 0));
    EXPECT_EQ(*image.Find("light.group.key.R"), *light.Find("key.R"));
    for (const std::string& channel : before.channel_names) {
      EXPECT_EQ(*image.Find(channel), *before.Find(channel)) << channel;
    }
    AddLight(camera, light, kWindow, &image);  // It may be there.
  }
}

TEST(LightImageTest, OnlyTheRectangleChanges) {
  FrameImage camera = MakeFrameImage(kWindow, 4, 3), light = camera, image = camera;
  DevelopTile(LightTile(), &light);
  AddLight(camera, light, {1, 1, 3, 2}, &image);
  EXPECT_EQ(At(image, "R", 0, 1), 0);
  EXPECT_GT(At(image, "R", 1, 1), 0);
  EXPECT_EQ(At(image, "R", 3, 1), 0);
}

TEST(LightImageTest, LightGroupsAddAndWhatIsNotFiniteIsCounted) {
  FilmOutputs outputs;
  outputs.light_groups = {"key", "rim"};
  FrameImage camera = MakeFrameImage(kWindow, 4, 3, outputs), light = camera, image = camera;
  DevelopTile(LightTile(outputs), &light);
  camera.Find("key.B")->assign(12, 0.5f);
  camera.Find("nonfinite")->assign(12, 1);
  light.Find("nonfinite")->assign(12, 2);
  AddLight(camera, light, kWindow, &image);
  EXPECT_EQ(At(image, "key.B", 1, 1), 0.5f + At(light, "key.B", 1, 1));
  EXPECT_EQ(At(image, "rim.B", 1, 1), 0);
  EXPECT_EQ(At(image, "nonfinite", 1, 1), 3);
}

// A light image whose passes have this bias in `biased`, with independent noise in the window.
FrameImage BiasedLight(const PixelRect& window, const PixelRect& biased, float bias, float noise) {
  FilmOutputs outputs;
  AddMergeBias(&outputs);
  FilmTile tile(window, {0, 16}, outputs);
  LightPassAccumulator film(&tile);
  for (uint64_t pass = 0; pass < 16; ++pass) {
    for (int32_t y = window.y0; y < window.y1; ++y) {
      for (int32_t x = window.x0; x < window.x1; ++x) {
        const float u = HashToUnit((pass * 4096 + static_cast<uint64_t>(y * 64 + x)));
        const bool has_bias = biased.Contains({x, y, x + 1, y + 1});
        film.AddBias(x, y, Rgb::Gray((has_bias ? bias : 0) + noise * (u - 0.5f)));
      }
    }
    film.EndPass();
  }
  film.Finish();
  FrameImage light = MakeFrameImage(window, window.x1, window.y1, outputs);
  DevelopTile(tile, &light);
  return light;
}

FrameImage BiasedLight(const PixelRect& window, float bias, float noise) {
  return BiasedLight(window, window, bias, noise);
}

TEST(LightImageTest, ErrorsIncludeTheBiasOfMerging) {
  constexpr PixelRect kWide{0, 0, 24, 24};
  FrameImage camera = MakeFrameImage(kWide, 24, 24), image = camera;
  camera.Find("stderr.G")->assign(24 * 24, 0.3f);
  AddLight(camera, BiasedLight(kWide, -0.4f, 0), kWide, &image);
  for (const int32_t x : {0, 12, 23}) {
    EXPECT_FLOAT_EQ(At(image, "stderr.G", x, 5), 0.5f);
    EXPECT_FLOAT_EQ(At(image, "stderr.R", x, 5), 0.4f);
  }
  // The noise of the estimate is no bias: without the product of halves it would be 0.1 here.
  AddLight(camera, BiasedLight(kWide, 0, 1.4f), kWide, &image);
  double square = 0;
  for (const float error : *image.Find("stderr.R")) square += double{error} * double{error};
  EXPECT_LT(std::sqrt(square / (24 * 24)), 0.05);
  AddLight(camera, BiasedLight(kWide, 0.4f, 1.4f), {3, 4, 5, 6}, &image);
  EXPECT_NEAR(At(image, "stderr.R", 4, 5), 0.4f, 0.08f);
}

TEST(LightImageTest, ErrorsIncludeTheBiasOfANarrowPeak) {
  constexpr PixelRect kWide{0, 0, 24, 24}, kPeak{11, 11, 14, 14};
  FrameImage camera = MakeFrameImage(kWide, 24, 24), image = camera;
  AddLight(camera, BiasedLight(kWide, kPeak, -0.4f, 0.3f), kWide, &image);
  EXPECT_NEAR(At(image, "stderr.R", 12, 12), 0.4f, 0.04f);
  EXPECT_LT(At(image, "stderr.R", 3, 3), 0.05f);
}

TEST(LightImageTest, TheBiasOfMergingIsALayer) {
  constexpr PixelRect kWide{0, 0, 8, 8};
  FrameImage camera = MakeFrameImage(kWide, 8, 8), image = camera;
  const FrameImage light = BiasedLight(kWide, 0.25f, 0);
  AddLight(camera, light, kWide, &image);
  EXPECT_EQ(image.Find("merge.bias.R"), nullptr);
  SetLightLayer(light, &image);
  EXPECT_FLOAT_EQ(At(image, "merge.bias.R", 3, 3), 0.25f);
  EXPECT_EQ(image.Find("merge.bias.even.R"), nullptr);
  EXPECT_EQ(At(image, "light.samples", 3, 3), 16);
}

}  // namespace
}  // namespace sheaf
