// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light/emission_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace sheaf::render {
namespace {

constexpr int kWidth = 5, kHeight = 3;

EmissionMap MapOfNumbers(float rest = 1) {
  std::vector<Rgb> texels;
  for (int i = 0; i < kWidth * kHeight; ++i) {
    texels.push_back({static_cast<float>(i + 1), 0, rest * static_cast<float>(i % 2)});
  }
  return *EmissionMap::Make(kWidth, kHeight, std::move(texels));
}

// The texel of a tiled plane.
int Folded(int64_t i, int count, TextureWrap wrap) {
  if (wrap == TextureWrap::kClamp) {
    return static_cast<int>(std::clamp<int64_t>(i, 0, count - 1));
  }
  const int period = wrap == TextureWrap::kMirror ? 2 * count : count;
  const int at = static_cast<int>(((i % period) + period) % period);
  return at < count ? at : 2 * count - 1 - at;
}

Rgb Expected(Vec2f uv, const EmissionPlacement& p) {
  const UvMapping& m = p.mapping;
  const double u = m.scale_u * uv.x + m.turn_u * uv.y + m.offset_u;
  const double v = m.scale_v * uv.y + m.turn_v * uv.x + m.offset_v;
  const double x = u * kWidth - 0.5, y = (1 - v) * kHeight - 0.5;
  Rgb sum;
  for (int dy = 0; dy < 2; ++dy) {
    for (int dx = 0; dx < 2; ++dx) {
      const double fx = x - std::floor(x), fy = y - std::floor(y);
      double weight = (dx == 0 ? 1 - fx : fx) * (dy == 0 ? 1 - fy : fy);
      if (p.is_nearest) weight = (dx == (fx >= 0.5)) && (dy == (fy >= 0.5)) ? 1 : 0;
      const int column = Folded(static_cast<int64_t>(std::floor(x)) + dx, kWidth, p.wrap_u);
      const int row = Folded(static_cast<int64_t>(std::floor(y)) + dy, kHeight, p.wrap_v);
      const int i = row * kWidth + column;
      sum +=
          Rgb{static_cast<float>(i + 1), 0, static_cast<float>(i % 2)} * static_cast<float>(weight);
    }
  }
  return sum;
}

std::vector<EmissionPlacement> Placements() {
  std::vector<EmissionPlacement> placements;
  constexpr TextureWrap kWraps[] = {TextureWrap::kClamp, TextureWrap::kRepeat,
                                    TextureWrap::kMirror};
  for (const TextureWrap u : kWraps) {
    for (const TextureWrap v : kWraps) {
      for (const bool is_nearest : {false, true}) {
        EmissionPlacement placement;
        placement.wrap_u = u;
        placement.wrap_v = v;
        placement.is_nearest = is_nearest;
        placements.push_back(placement);
        placement.mapping.scale_u = 0.5f;
        placement.mapping.scale_v = -2;
        placement.mapping.turn_u = 0.75f;
        placement.mapping.turn_v = 0.25f;
        placement.mapping.offset_u = 3;
        placements.push_back(placement);
      }
    }
  }
  return placements;
}

TEST(EmissionMapTest, ImagesAreTiledAsPlaced) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> coordinate(-4, 4);
  for (const EmissionPlacement& placement : Placements()) {
    const EmissionMap map = MapOfNumbers().Placed(placement);
    for (int i = 0; i < 500; ++i) {
      const Vec2f uv{coordinate(random), coordinate(random)};
      const Rgb seen = map.At(uv), expected = Expected(uv, placement);
      // Where the nearest texel changes, rounding decides.
      bool is_certain = true;
      for (const float du : {-1e-4f, 1e-4f}) {
        for (const float dv : {-1e-4f, 1e-4f}) {
          const Vec2f beside{uv.x + du, uv.y + dv};
          is_certain =
              is_certain && (!placement.is_nearest || Expected(beside, placement) == expected);
        }
      }
      if (!is_certain) continue;
      ASSERT_NEAR(seen.r, expected.r, 1e-3f) << uv.x << " " << uv.y;
      ASSERT_NEAR(seen.b, expected.b, 1e-3f);
    }
  }
}

TEST(EmissionMapTest, DefaultsKeepTheEdges) {
  const EmissionMap map = MapOfNumbers();
  EXPECT_EQ(map.At({-7, 9}).r, 1);
  EXPECT_EQ(map.At({7, -9}).r, kWidth * kHeight);
  EXPECT_EQ(map.At({std::nanf(""), 1}).r, 1);
}

// A single texel that shines, of which no box that sees it may say that it is dark.
TEST(EmissionMapTest, BoxesThatShineAreNeverDark) {
  std::mt19937 random(4);
  std::uniform_real_distribution<float> coordinate(-3, 3), size(0, 1.5f), part(0, 1);
  for (const int edge : {5, 64}) {
    std::vector<Rgb> texels(static_cast<size_t>(edge * edge));
    texels[static_cast<size_t>(edge + 3)] = Rgb::Gray(1);
    const EmissionMap image = *EmissionMap::Make(edge, edge, texels);
    for (const EmissionPlacement& placement : Placements()) {
      const EmissionMap map = image.Placed(placement);
      for (int i = 0; i < 300; ++i) {
        const Vec2f lower{coordinate(random), coordinate(random)};
        const Vec2f upper{lower.x + size(random), lower.y + size(random)};
        const double mean = map.MeanLuminance(lower, upper);
        for (int k = 0; k < 30 && mean == 0; ++k) {
          const Vec2f uv{lower.x + part(random) * (upper.x - lower.x),
                         lower.y + part(random) * (upper.y - lower.y)};
          ASSERT_TRUE(map.At(uv).IsBlack()) << uv.x << " " << uv.y;
        }
      }
    }
  }
}

TEST(EmissionMapTest, PlacedMapsShareTheirImage) {
  const EmissionMap map = MapOfNumbers();
  EmissionPlacement placement;
  placement.wrap_u = TextureWrap::kRepeat;
  EXPECT_EQ(map.Placed(placement).image_identity(), map.image_identity());
  EXPECT_NE(MapOfNumbers().image_identity(), map.image_identity());
}

}  // namespace
}  // namespace sheaf::render
