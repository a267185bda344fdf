// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light_film.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "worker/render/camera/camera.h"

namespace sheaf::render {
namespace {

using Kind = FilterDescription::Kind;
using CameraKind = CameraDescription::Kind;

constexpr int32_t kWidth = 12, kHeight = 8;
constexpr PixelRect kWhole{0, 0, kWidth, kHeight};

PixelFilter MakeFilter(Kind kind, float radius_x_px, float radius_y_px) {
  SceneDescription scene;
  scene.files = {"room.pbrt"};
  scene.filter.kind = kind;
  scene.filter.radius_x_px = radius_x_px;
  scene.filter.radius_y_px = radius_y_px;
  return *PixelFilter::Make(scene);
}

LightFilm FilmOf(const PixelFilter& filter, FilmEdges edges = FilmEdges::kNone,
                 const PixelRect& window = kWhole) {
  return {window, kWidth, kHeight, edges, &filter, {}};
}

// A pass of one splat.
FilmTile SplatOnce(const LightFilm& film, Vec2d raster, const Rgb& value = {1, 1, 1}) {
  std::vector<LostSplat> lost;
  return *SumLightPasses(
      film, {0, 1},
      [&](uint64_t, SplatSink* splats) {
        splats->Add(raster, value, LightPathKind::kCaustic, 0);
        return absl::OkStatus();
      },
      &lost);
}

double SumOf(const FilmTile& tile, FilmChannel hi = FilmChannel::kRedHi) {
  double sum = 0;
  for (size_t p = 0; p < tile.plane_size(); ++p) sum += double{tile.channel(hi)[p]};
  return sum;
}

TEST(LightFilmTest, ABoxOfOnePixelGivesAllToOnePixel) {
  const PixelFilter filter = MakeFilter(Kind::kBox, 0.5f, 0.5f);
  const FilmTile tile = SplatOnce(FilmOf(filter), {4.99, 3.0}, {2, 0, 0});
  EXPECT_EQ(tile.channel(FilmChannel::kRedHi)[kWhole.IndexOf(4, 3)], 2);
  EXPECT_EQ(SumOf(tile), 2);
}

// On average over film points within a pixel, the pixels get what the splat has, whatever the
// filter's shape and sign.
TEST(LightFilmTest, PixelsGetTheValueOfTheSplat) {
  for (const Kind kind :
       {Kind::kBox, Kind::kTriangle, Kind::kGaussian, Kind::kMitchell, Kind::kSinc}) {
    const PixelFilter filter = MakeFilter(kind, 2, 1.5f);
    constexpr int kSide = 16;
    double sum = 0;
    float least = 0;
    for (int i = 0; i < kSide * kSide; ++i) {
      const Vec2d raster{5 + (i % kSide + 0.5) / kSide, 4 + (i / kSide + 0.5) / kSide};
      const FilmTile tile = SplatOnce(FilmOf(filter), raster);
      sum += SumOf(tile);
      least =
          std::min(least, *std::min_element(tile.channel(FilmChannel::kRedHi),
                                            tile.channel(FilmChannel::kRedHi) + tile.plane_size()));
    }
    EXPECT_NEAR(sum / (kSide * kSide), 1, 2e-3) << static_cast<int>(kind);
    EXPECT_EQ(least < 0, kind == Kind::kMitchell || kind == Kind::kSinc);
  }
}

TEST(LightFilmTest, ACropIsThatPartOfTheWhole) {
  const PixelFilter filter = MakeFilter(Kind::kGaussian, 1.5f, 1.5f);
  const PixelRect crop{3, 2, 7, 6};
  for (const FilmEdges edges : {FilmEdges::kNone, FilmEdges::kEquirectangular}) {
    for (const Vec2d raster : {Vec2d{3.2, 2.1}, Vec2d{2.4, 5.9}, Vec2d{-0.4, 3}, Vec2d{6, 8.2}}) {
      const FilmTile whole = SplatOnce(FilmOf(filter, edges), raster);
      const FilmTile part = SplatOnce(FilmOf(filter, edges, crop), raster);
      for (int32_t y = crop.y0; y < crop.y1; ++y) {
        for (int32_t x = crop.x0; x < crop.x1; ++x) {
          EXPECT_EQ(part.channel(FilmChannel::kRedHi)[crop.IndexOf(x, y)],
                    whole.channel(FilmChannel::kRedHi)[kWhole.IndexOf(x, y)]);
        }
      }
    }
  }
}

// A camera sample of a pixel at the edge may lie outside of the frame. The film point where the
// camera sees the same direction inside has an image exactly there.
TEST(LightFilmTest, ImagesAreWhereTheCameraContinuesItsMap) {
  const PixelFilter filter = MakeFilter(Kind::kGaussian, 3, 3);
  std::mt19937 bits(5);
  std::uniform_real_distribution<double> unit(0, 1);
  for (const CameraKind kind : {CameraKind::kEquirectangular, CameraKind::kEqualArea}) {
    SceneDescription scene;
    scene.camera.kind = kind;
    const absl::StatusOr<Camera> camera = Camera::Make(scene, kWidth, kHeight, {0, 0, 0});
    ASSERT_TRUE(camera.ok()) << camera.status();
    const LightFilm film = FilmOf(filter, FilmEdgesOf(scene.camera));
    int outside = 0;
    for (int i = 0; i < 2000; ++i) {
      const Vec2d sample{-2.9 + unit(bits) * (kWidth + 5.8), -2.9 + unit(bits) * (kHeight + 5.8)};
      const bool inside = sample.x > 0 && sample.x < kWidth && sample.y > 0 && sample.y < kHeight;
      outside += inside ? 0 : 1;
      const Ray ray = camera->MakeRay<0>(sample, {0.5f, 0.5f}, 0);
      const auto seen = camera->SampleWi(ray.o + ray.d, {0.5f, 0.5f}, 0);
      ASSERT_TRUE(seen.has_value());
      double nearest = std::numeric_limits<double>::infinity();
      for (const Vec2d& image : ImagesOf(film, seen->film, filter.radius_px())) {
        nearest = std::min(nearest, std::hypot(image.x - sample.x, image.y - sample.y));
      }
      EXPECT_LT(nearest, 1e-3) << sample.x << ", " << sample.y;
    }
    EXPECT_GT(outside, 500);
  }
}

// A spherical map has no edge: nothing of a splat is lost there.
TEST(LightFilmTest, SplatsAtTheEdgeOfASphereAreWhole) {
  const PixelFilter filter = MakeFilter(Kind::kMitchell, 2, 2);  // Sums to 1 over pixels anywhere.
  for (const FilmEdges edges : {FilmEdges::kEquirectangular, FilmEdges::kEqualArea}) {
    for (const Vec2d raster : {Vec2d{0.1, 3.3}, Vec2d{11.7, 5.2}, Vec2d{4.2, 0.3}, Vec2d{8.9, 7.6},
                               Vec2d{0.2, 0.4}, Vec2d{11.5, 7.9}, Vec2d{6, 4}}) {
      EXPECT_NEAR(SumOf(SplatOnce(FilmOf(filter, edges), raster)), 1, 1e-4)
          << raster.x << ", " << raster.y;
    }
  }
  EXPECT_LT(SumOf(SplatOnce(FilmOf(filter), {0.1, 3.3})), 0.9);
}

TEST(LightFilmTest, SplatsThatAreNotFiniteAreCountedAndReported) {
  const PixelFilter filter = MakeFilter(Kind::kBox, 0.5f, 0.5f);
  std::vector<LostSplat> lost;
  const absl::StatusOr<FilmTile> tile = SumLightPasses(
      FilmOf(filter), {2, 2},
      [&](uint64_t pass, SplatSink* splats) {
        const float bad = pass == 3 ? std::nanf("") : 1;
        splats->Add({5.5, 6.5}, {1, bad, 1}, LightPathKind::kDirect, 0);
        splats->Add({std::nan(""), 1}, {1, 1, 1}, LightPathKind::kDirect, 0);
        splats->Add({1e300, -1e300}, {1, 1, 1}, LightPathKind::kDirect, 0);  // Misses the frame.
        return absl::OkStatus();
      },
      &lost);
  ASSERT_TRUE(tile.ok());
  EXPECT_EQ(SumOf(*tile, FilmChannel::kNonFiniteCount), 3);
  EXPECT_EQ(tile->channel(FilmChannel::kNonFiniteCount)[kWhole.IndexOf(5, 6)], 1);
  EXPECT_EQ(tile->channel(FilmChannel::kRedHi)[kWhole.IndexOf(5, 6)], 1);
  ASSERT_EQ(lost.size(), 3u);
  EXPECT_EQ(lost[1].pass, 3u);
}

// Layers of kinds of paths, and groups otherwise.
TEST(LightFilmTest, SplatsGoToTheirLayer) {
  const PixelFilter filter = MakeFilter(Kind::kBox, 0.5f, 0.5f);
  LightFilm film = FilmOf(filter);
  film.outputs.light_groups = {"key", "rim"};
  std::vector<LostSplat> lost;
  const auto trace = [](uint64_t, SplatSink* splats) {
    splats->Add({1.5, 1.5}, {1, 2, 3}, LightPathKind::kCaustic, 1);
    return absl::OkStatus();
  };
  const size_t p = kWhole.IndexOf(1, 1);
  absl::StatusOr<FilmTile> tile = SumLightPasses(film, {0, 1}, trace, &lost);
  EXPECT_EQ(tile->mean(3, 0)[p], 1);
  EXPECT_EQ(tile->mean(0, 0)[p], 0);
  film.outputs.AddLightPaths();
  tile = SumLightPasses(film, {0, 1}, trace, &lost);
  EXPECT_EQ(tile->mean(3 * static_cast<size_t>(LightPathKind::kCaustic) + 2, 0)[p], 3);
}

// Blocks of more passes than an accumulator holds are merged from smaller ones.
TEST(LightFilmTest, LargeBlocksAreMerged) {
  const PixelFilter filter = MakeFilter(Kind::kTriangle, 1, 1);
  std::vector<LostSplat> lost;
  const auto trace = [](uint64_t pass, SplatSink* splats) {
    const auto number = static_cast<float>(pass);
    splats->Add({1.5 + static_cast<double>(number) / 10, 1.2}, {1 / (number + 3), 1, 1},
                LightPathKind::kCaustic, 0);
    return absl::OkStatus();
  };
  const absl::StatusOr<FilmTile> whole = SumLightPasses(FilmOf(filter), {0, 64}, trace, &lost);
  FilmTile left = *SumLightPasses(FilmOf(filter), {0, 32}, trace, &lost);
  EXPECT_EQ(*whole, MergeSiblings(left, *SumLightPasses(FilmOf(filter), {32, 32}, trace, &lost)));
  EXPECT_EQ(whole->channel(FilmChannel::kSampleCount)[0], 64);
}

TEST(LightFilmTest, AStoppedPassEndsTheBlock) {
  const PixelFilter filter = MakeFilter(Kind::kBox, 0.5f, 0.5f);
  std::vector<LostSplat> lost;
  const absl::StatusOr<FilmTile> tile = SumLightPasses(
      FilmOf(filter), {0, 4},
      [](uint64_t pass, SplatSink*) {
        return pass == 2 ? absl::CancelledError("stopped") : absl::OkStatus();
      },
      &lost);
  EXPECT_TRUE(absl::IsCancelled(tile.status()));
}

}  // namespace
}  // namespace sheaf::render
