// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/error/flip.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

namespace sheaf {
namespace {

struct Planes {
  int32_t width_px = 0, height_px = 0;
  std::array<std::vector<float>, 3> rgb;
  FlipImage Image() const {
    return {width_px, height_px, {rgb[0].data(), rgb[1].data(), rgb[2].data()}};
  }
};

using ColorAt = std::function<std::array<double, 3>(int32_t x, int32_t y)>;
Planes DrawPlanes(int32_t width_px, int32_t height_px, const ColorAt& color_at) {
  Planes planes{width_px, height_px, {}};
  for (int32_t y = 0; y < height_px; ++y) {
    for (int32_t x = 0; x < width_px; ++x) {
      const std::array<double, 3> color = color_at(x, y);
      for (size_t i = 0; i < 3; ++i) planes.rgb[i].push_back(static_cast<float>(color[i]));
    }
  }
  return planes;
}
Planes Flat(const std::array<double, 3>& color) {
  return DrawPlanes(9, 8, [&](int32_t, int32_t) { return color; });
}

// Two images with edges and points in all channels.
Planes Pattern(bool changed) {
  return DrawPlanes(48, 40, [changed](int32_t x, int32_t y) -> std::array<double, 3> {
    if (!changed) {
      return {(7 * x + 3 * y) % 16 / 16.0, (x / 8 + y / 8) % 2 * 0.75, x * y % 32 / 32.0};
    }
    return {(7 * x + 3 * y) % 16 / 16.0 * 0.8, (x / 8 + y / 8 + (x % 5 == 0)) % 2 * 0.75,
            (x * y + 3 * x) % 32 / 32.0};
  });
}

double Mean(const Planes& a, const Planes& b) { return MeanFlip(a.Image(), b.Image()); }

// By hand from the paper: HyAB from black to white is 100, from green to blue 203.4.
TEST(FlipTest, FlatColorsMatchThePaper) {
  EXPECT_EQ(Mean(Flat({0.2, 0.3, 0.4}), Flat({0.2, 0.3, 0.4})), 0);
  EXPECT_NEAR(Mean(Flat({0, 1, 0}), Flat({0, 0, 1})), 1, 1e-4);
  EXPECT_NEAR(Mean(Flat({0, 0, 0}), Flat({1, 1, 1})), 0.96738, 1e-4);
  EXPECT_NEAR(Mean(Flat({1, 0, 0}), Flat({0, 0, 0})), 0.97050, 1e-4);
  EXPECT_NEAR(Mean(Flat({0.5, 0.5, 0.5}), Flat({0.52, 0.52, 0.52})), 0.06581, 1e-4);
}

// The expected values come from an independent program, in double, that does not separate its
// filters: sums over 21 x 21 and 19 x 19 pixels as in the paper.
TEST(FlipTest, SeparableFiltersMatchFullConvolutions) {
  const Planes reference = Pattern(false), image = Pattern(true);
  EXPECT_NEAR(Mean(reference, image), 0.544191, 5e-5);
  const std::vector<float> map = FlipMap(reference.Image(), image.Image());
  EXPECT_NEAR(map[7 * 48 + 5], 0.559828, 2e-4);
  EXPECT_NEAR(map[47], 0.662112, 2e-4);  // Corners: the edge is repeated beyond them.
  EXPECT_NEAR(map[39 * 48], 0.980395, 2e-4);
  const Planes black = DrawPlanes(32, 32, [](int32_t, int32_t) { return std::array<double, 3>{}; });
  const Planes step = DrawPlanes(32, 32, [](int32_t x, int32_t) {
    const double v = x < 16 ? 0 : 1;
    return std::array<double, 3>{v, v, v};
  });
  EXPECT_NEAR(Mean(step, black), 0.572674, 5e-5);
}

TEST(FlipTest, IsSymmetricAndIgnoresUndisplayableValues) {
  const Planes reference = Pattern(false), image = Pattern(true);
  EXPECT_EQ(Mean(reference, image), Mean(image, reference));
  Planes bright = Flat({5, 5, 5}), strange = Flat({-1, 0, std::nan("")});
  EXPECT_EQ(Mean(bright, Flat({1, 1, 1})), 0);
  EXPECT_EQ(Mean(strange, Flat({0, 0, 0})), 0);
  bright.rgb[0][3] = std::numeric_limits<float>::infinity();
  EXPECT_EQ(Mean(bright, Flat({1, 1, 1})), 0);
}

// The next free thread processes the next band, so bands are finished in any order.
TEST(FlipTest, BandsAreSeamless) {
  const auto tall = [](bool changed) {
    return DrawPlanes(24, 400, [changed](int32_t x, int32_t y) {
      const double v = (y % 4 == 0 ? 0.7 : 0.2) + (changed ? 0.01 * (x % 3) : 0);
      return std::array<double, 3>{v, v, 0.5 * v};
    });
  };
  const Planes reference = tall(false), image = tall(true);
  const std::vector<float> map = FlipMap(reference.Image(), image.Image());
  // The pattern repeats every four rows, except near the top and bottom.
  for (size_t y = 16; y < 380; ++y) {
    for (size_t x = 0; x < 24; ++x) ASSERT_EQ(map[y * 24 + x], map[(y - 4) * 24 + x]) << y;
  }
  EXPECT_EQ(map, FlipMap(reference.Image(), image.Image()));
}

TEST(FlipTest, HdrFlipTakesTheWorstExposure) {
  const auto bright = [](bool changed) {
    Planes planes = Pattern(changed);
    for (std::vector<float>& plane : planes.rgb) {
      for (size_t p = 0; p < plane.size(); ++p) {
        plane[p] = plane[p] * (p % 48 < 12 ? 100.0f : 0.05f) + 0.001f;
      }
    }
    return planes;
  };
  const Planes reference = bright(false), image = bright(true);
  EXPECT_NEAR(MeanHdrFlip(reference.Image(), image.Image()), 0.552624, 1e-3);
  EXPECT_EQ(MeanHdrFlip(reference.Image(), reference.Image()), 0);
  const Planes black = Flat({0, 0, 0});
  EXPECT_EQ(MeanHdrFlip(black.Image(), black.Image()), 0);
}

}  // namespace
}  // namespace sheaf
