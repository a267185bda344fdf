// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/denoise/denoise.h"

#include <gtest/gtest.h>

#include <cmath>

#include "common/film/denoise/denoise_test_film.h"

namespace sheaf {
namespace {

using Planes3 = std::array<std::vector<float>, 3>;

constexpr int32_t kSize = 48;

Planes3 ColorOf(const FrameImage& image) {
  return {*image.Find("R"), *image.Find("G"), *image.Find("B")};
}

// Light and albedo jump in the middle; elsewhere light is a ramp.
SyntheticPixel TwoWalls(int32_t x, int32_t y) {
  const bool is_left = x < kSize / 2;
  const double ramp = 1 + 0.004 * y;
  return {is_left ? ramp : 1.3 * ramp, 0.8, is_left ? 0.3F : 0.7F};
}

// Fine texture that no guide shows, with little noise.
SyntheticPixel Texture(int32_t x, int32_t y) {
  return {1 + 0.5 * std::sin(2.1 * x) * std::cos(1.7 * y), 0.01, 0.5F};
}

TEST(DenoiseTest, KeepsAConstantImage) {
  const SyntheticFilm film = MakeSyntheticFilm(kSize, 16, 1, [](int32_t, int32_t) {
    return SyntheticPixel{0.7, 0, 0.5F};
  });
  const DenoisedLight light = Denoise(film.image, film.halves, 1);
  EXPECT_EQ(light.color, ColorOf(film.image));
  for (const std::vector<float>& plane : light.error) {
    for (const float error : plane) EXPECT_LT(error, 1e-6F);
  }
}

TEST(DenoiseTest, RemovesNoise) {
  const auto flat = [](int32_t, int32_t) { return SyntheticPixel{1, 1, 0.5F}; };
  const SyntheticFilm film = MakeSyntheticFilm(kSize, 16, 2, flat);
  const double before = SyntheticError(ColorOf(film.image), kSize, flat);
  const DenoisedLight light = Denoise(film.image, film.halves, 1);
  EXPECT_LT(SyntheticError(light.color, kSize, flat), before / 20);
}

TEST(DenoiseTest, KeepsEdgesOfGuides) {
  const SyntheticFilm film = MakeSyntheticFilm(kSize, 16, 3, TwoWalls);
  const DenoisedLight light = Denoise(film.image, film.halves, 1);
  double left = 0, right = 0;
  for (size_t y = 0; y < kSize; ++y) {
    left += double{light.color[0][y * kSize + kSize / 2 - 1]} / kSize;
    right += double{light.color[0][y * kSize + kSize / 2]} / kSize;
  }
  EXPECT_NEAR(right / left, 1.3, 0.05);
}

TEST(DenoiseTest, IsNotWorseThanAConvergedImage) {
  const SyntheticFilm film = MakeSyntheticFilm(kSize, 1024, 4, Texture);
  const double before = SyntheticError(ColorOf(film.image), kSize, Texture);
  const DenoisedLight light = Denoise(film.image, film.halves, 1);
  EXPECT_LT(SyntheticError(light.color, kSize, Texture), 1.01 * before);
}

// Both its parts: the variance and, from texture that no guide shows, the squared bias. Over
// several images, so that the noise of one matters less.
TEST(DenoiseTest, ExpectsItsError) {
  constexpr int32_t kWide = 96;
  const auto rough = [](int32_t x, int32_t y) {
    return SyntheticPixel{1 + 0.15 * std::sin(0.4 * x) * std::cos(0.3 * y), 0.8, 0.5F};
  };
  double expected = 0, error = 0;
  for (uint64_t seed = 10; seed < 13; ++seed) {
    const SyntheticFilm film = MakeSyntheticFilm(kWide, 16, seed, rough);
    const DenoisedLight light = Denoise(film.image, film.halves, 1);
    expected += light.mse;
    error += SyntheticError(light.color, kWide, rough);
  }
  EXPECT_NEAR(expected / error, 1, 0.25);
}

TEST(DenoiseTest, IsTheSameWithAnyNumberOfThreads) {
  const SyntheticFilm film = MakeSyntheticFilm(kSize, 16, 5, TwoWalls);
  const DenoisedLight one = Denoise(film.image, film.halves, 1);
  const DenoisedLight three = Denoise(film.image, film.halves, 3);
  EXPECT_EQ(one.color, three.color);
  EXPECT_EQ(one.error, three.error);
  EXPECT_EQ(one.mse, three.mse);
}

TEST(DenoiseTest, KeepsPixelsWithoutVariances) {
  const SyntheticFilm film = MakeSyntheticFilm(kSize, 2, 6, TwoWalls);
  const DenoisedLight light = Denoise(film.image, film.halves, 1);
  EXPECT_EQ(light.color, ColorOf(film.image));
}

TEST(DenoiseTest, FillsTheLayersOfTheImage) {
  SyntheticFilm film = MakeSyntheticFilm(kSize, 16, 7, TwoWalls);
  const Planes3 before = ColorOf(film.image);
  const DenoisedLight light = Denoise(film.image, film.halves, 1);
  SetDenoised(light, &film.image);
  EXPECT_EQ(ColorOf(film.image), before);
  EXPECT_EQ(*film.image.Find("denoised.G"), light.color[1]);
  EXPECT_EQ(*film.image.Find("denoisedError.B"), light.error[2]);
}

}  // namespace
}  // namespace sheaf
