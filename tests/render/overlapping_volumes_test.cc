// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Grids that overlap, which are tracked as one medium: against closed forms, against the same grids
// tracked one by one, and which of them are merged.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/hard_case.h"
#include "tests/support/long_tests.h"
#include "tests/support/naive_media.h"
#include "tests/support/test_scene.h"
#include "worker/render/medium/merged_medium.h"
#include "worker/render/sampling/event_stream.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {
namespace {

struct BlockOf {
  Vec3f lo, hi;
  Rgb sigma_a, sigma_s;
  float g = 0;
  Rgb radiance{};
};

// Cells of a block along z. As in pbrt-v4, the density falls to half its value within half a cell
// of a face; a ray through both faces has this part of the optical depth of an even block.
constexpr int32_t kBlockCells = 64;
constexpr double kBlockDepth = 1 - 0.25 / kBlockCells;

// The camera looks along z, from (0, 0, -2), with rays that are nearly parallel.
class BlockScene : public TestScene {
 public:
  explicit BlockScene(Vec3d eye = {0, 0, -2}) : TestScene(eye, {0, 0, 1}, 1e-3f) {}

  // A grid that fills its box. values: its cells, as many along x as along y. surface_factor: the
  // size of its surface, relative to the box.
  int32_t AddGrid(const BlockOf& block, std::vector<float> values, int32_t side,
                  float surface_factor = 1) {
    MediumDescription medium;
    medium.name = std::to_string(scene.media.size());
    medium.sigma_a.rgb = block.sigma_a;
    medium.sigma_s.rgb = block.sigma_s;
    medium.g = block.g;
    medium.emits = !block.radiance.IsBlack();
    medium.radiance.rgb = block.radiance;
    UniformGridMedium grid;
    grid.box = {{side, side, static_cast<int32_t>(values.size()) / (side * side)},
                ToDouble(block.lo),
                ToDouble(block.hi)};
    grid.density = std::move(values);
    medium.kind = std::move(grid);
    scene.media.push_back(std::move(medium));
    const auto index = static_cast<int32_t>(scene.media.size() - 1);
    const Vec3f center = (block.lo + block.hi) * 0.5f, half = (block.hi - block.lo) * 0.5f;
    AddShape(MeshShape{Box(center - half * surface_factor, center + half * surface_factor)},
             AddMaterial(InterfaceMaterial{}))
        .media = {index, kNone};
    return index;
  }
  // The same with a density of 1.
  int32_t AddBlock(const BlockOf& block) {
    return AddGrid(block, std::vector<float>(3 * 3 * kBlockCells, 1.0f), 3);
  }
};

std::vector<float> Wisp(uint32_t seed, int side) {
  EventStream random({seed, 7, 0, 0});
  std::vector<float> values(static_cast<size_t>(side) * side * side);
  for (float& v : values) {
    const double u = random.Uniform();
    v = u < 0.5 ? 0.0f : static_cast<float>(3 * u * u);
  }
  return values;
}

struct Rendered {
  TileMean mean;
  size_t merged_count = 0;
};
Rendered Render(const TestScene& t, int samples, ColorTransport color = ColorTransport::kRgb,
                const CompileTechniques& techniques = {}) {
  FrameSettings settings = SquareSettings(8, samples, 64);
  settings.color = color;
  const CompiledScenePtr compiled = Compile(t.scene, settings, techniques);
  RenderStats stats;
  const FilmTile film = RenderAll(*compiled, &stats);
  EXPECT_EQ(stats.broken_majorants, 0u);
  // The faces of volumes that are not merged coincide.
  if (techniques.merge_media) {
    EXPECT_EQ(stats.broken_nestings, 0u);
  }
  return {MeanOf(film), compiled->media->merged_count()};
}
void ExpectEqual(const TileMean& a, const TileMean& b) {
  for (size_t c = 0; c < 3; ++c) {
    const double error = std::hypot(a.standard_error[c], b.standard_error[c]);
    EXPECT_NEAR(a.mean[c], b.mean[c], 5 * error) << c;
    EXPECT_LT(error, 0.06 * std::max<double>(b.mean[c], 0.1)) << c;
  }
}

// V8: thirty blocks at one place and more than a path can be in at once: light passes through all.
TEST(OverlappingVolumesTest, V8TransmittanceIsThatOfTheSum) {
  for (const int count : {2, 30, 100}) {
    BlockScene t;
    t.ConstantEnvironment(Rgb::Gray(1));
    double depth = 0;
    for (int i = 0; i < count; ++i) {
      const float end = 0.5f + 0.005f * static_cast<float>(i);
      const float sigma = 2.0f / static_cast<float>(count) * (i % 2 == 0 ? 0.5f : 1);
      t.AddBlock({{-1, -1, -end}, {1, 1, end}, Rgb::Gray(sigma), {}});
      depth += 2 * static_cast<double>(end) * static_cast<double>(sigma);
    }
    const Rendered it = Render(t, 64);
    EXPECT_EQ(it.merged_count, static_cast<size_t>(count));
    ExpectHardCase({.row = "V8",
                    .figure = "light through " + std::to_string(count) + " grids at one place",
                    .expected = std::exp(-kBlockDepth * depth),
                    .measured = it.mean.mean.g,
                    .standard_error = it.mean.standard_error.g,
                    .tolerance = 2e-5,
                    .naive = naive::Transmittance(2.0f / static_cast<float>(count), 1),
                    .naive_by = "the grid that was entered last"});
  }
}

// Blocks that overlap in part: each factor has its own length.
TEST(OverlappingVolumesTest, BlocksThatOverlapInPart) {
  BlockScene t;
  t.ConstantEnvironment({1, 0.5f, 2});
  t.AddBlock({{-1, -1, -1}, {1, 1, 0.5f}, {1, 0.2f, 3}, {}});
  t.AddBlock({{-1, -1, -0.5f}, {1, 1, 1}, {0.3f, 2, 0.1f}, {}});
  const Rendered it = Render(t, 256);
  EXPECT_EQ(it.merged_count, 2u);
  const Rgb sky{1, 0.5f, 2}, sum{1.3f, 2.2f, 3.1f};
  for (size_t c = 0; c < 3; ++c) {
    const double expected = double{sky[c]} * std::exp(-1.5 * kBlockDepth * double{sum[c]});
    EXPECT_NEAR(it.mean.mean[c], expected, 5 * it.mean.standard_error[c] + 1e-5) << c;
    EXPECT_LT(it.mean.standard_error[c], 0.15 * expected) << c;
  }
}

TEST(OverlappingVolumesTest, WhiteFurnace) {
  for (const ColorTransport color : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
    BlockScene t;
    t.ConstantEnvironment(Rgb::Gray(1));
    for (uint32_t i = 0; i < 8; ++i) {
      const float z = -0.4f + 0.1f * static_cast<float>(i);
      t.AddGrid({{-1, -1, z - 1}, {1, 1, z + 1}, {}, {2, 1, 0.5f}, 0.1f * static_cast<float>(i)},
                Wisp(i, 12), 12);
    }
    FrameSettings settings = SquareSettings(8, DrawCount(64, 1024), 1 << 20);
    settings.color = color;
    const CompiledScenePtr compiled = Compile(t.scene, settings);
    EXPECT_EQ(compiled->media->merged_count(), 8u);
    ExpectMean(MeanOf(RenderAll(*compiled)), Rgb::Gray(1));
  }
}

// Light of both media, through both.
TEST(OverlappingVolumesTest, EmissionAddsUp) {
  BlockScene t;
  const double a = 0.7, b = 1.9, le_a = 1, le_b = 0.25;
  t.AddBlock({{-1, -1, -1}, {1, 1, 0.5f}, Rgb::Gray(0.7f), {}, 0, Rgb::Gray(1)});
  t.AddBlock({{-1, -1, -0.5f}, {1, 1, 1}, Rgb::Gray(1.9f), {}, 0, Rgb::Gray(0.25f)});
  const Rendered it = Render(t, 256);
  EXPECT_EQ(it.merged_count, 2u);
  const auto slab = [](double sigma, double emitted, double length) {
    return emitted / sigma * (1 - std::exp(-sigma * length));
  };
  const double expected = slab(a, a * le_a, 0.5) +
                          std::exp(-a * 0.5) * slab(a + b, a * le_a + b * le_b, 1) +
                          std::exp(-a * 1.5 - b) * slab(b, b * le_b, 0.5);
  EXPECT_NEAR(it.mean.mean.g, expected, 5 * it.mean.standard_error.g);
  EXPECT_LT(it.mean.standard_error.g, 0.01 * expected);
}

// Wisps of several colors, one that emits and one that only absorbs, in any color transport: merged
// and one by one.
TEST(OverlappingVolumesTest, MergedEqualsOneByOne) {
  BlockScene t;
  t.ConstantEnvironment({0.5f, 0.7f, 1});
  const std::array<Rgb, 3> scattering{Rgb{2, 1, 0.4f}, Rgb{0.3f, 1, 2}, Rgb{}};
  for (uint32_t i = 0; i < 9; ++i) {
    const float z = -0.4f + 0.1f * static_cast<float>(i), x = 0.05f * static_cast<float>(i % 4);
    t.AddGrid({{x - 1, -1, z - 0.8f},
               {x + 0.9f, 1, z + 0.8f},
               {0.1f, 0.4f, 0.2f},
               scattering[i % 3],
               0.2f * static_cast<float>(i % 3),
               i == 4 ? Rgb{0.5f, 0.2f, 0.1f} : Rgb{}},
              Wisp(i, 14), 14);
  }
  const int samples = DrawCount(64, 4096);
  for (const ColorTransport color : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
    const Rendered merged = Render(t, samples, color);
    const Rendered apart = Render(t, samples, color, {.merge_media = false});
    EXPECT_EQ(merged.merged_count, 9u);
    EXPECT_EQ(apart.merged_count, 0u);
    ExpectEqual(merged.mean, apart.mean);
  }
  // The same with light gathered along lines.
  const Rendered lines =
      Render(t, samples, ColorTransport::kRgb, {.equiangular_mode = EquiangularMode::kAlways});
  ExpectEqual(lines.mean, Render(t, samples).mean);
}

// A camera in the box around the volumes: in none of them, or in one that the scene names.
TEST(OverlappingVolumesTest, TheCameraMayBeAmongThem) {
  for (const bool is_in_one : {false, true}) {
    BlockScene t(is_in_one ? Vec3d{0, 0, -0.75} : Vec3d{0, 0, -0.95});
    t.ConstantEnvironment(Rgb::Gray(1));
    const int32_t first = t.AddBlock({{-1, -1, -0.9f}, {1, 1, 1}, Rgb::Gray(0.5f), {}});
    t.AddBlock({{-1, -1, -0.5f}, {1, 1, 1}, Rgb::Gray(0.25f), {}});
    t.AddBlock({{-1, 0.5f, -1}, {1, 1, 1}, Rgb::Gray(3), {}});  // Beside the rays.
    if (is_in_one) t.scene.camera.medium = first;
    const Rendered it = Render(t, 64);
    EXPECT_EQ(it.merged_count, 3u);
    const double depth = 0.5 * (is_in_one ? 1.75 : 1.9) + 0.25 * 1.5;
    EXPECT_NEAR(it.mean.mean.g, std::exp(-depth), 5 * it.mean.standard_error.g + 1e-3);
  }
}

// A medium stays as it is where merging would change the picture.
TEST(OverlappingVolumesTest, OthersAreNotMerged) {
  const BlockOf block{{-1, -1, -1}, {1, 1, 1}, Rgb::Gray(0.5f), {}};
  const auto count = [&](const auto& change) {
    BlockScene t;
    t.ConstantEnvironment(Rgb::Gray(1));
    t.AddBlock(block);
    change(&t);
    return Render(t, 16).merged_count;
  };
  EXPECT_EQ(count([&](BlockScene* t) { t->AddBlock(block); }), 2u);
  // A surface that cuts into the grid, one with a medium in front, a medium of two surfaces, and
  // volumes that hardly overlap.
  EXPECT_EQ(count([&](BlockScene* t) { t->AddGrid(block, std::vector<float>(27, 1.0f), 3, 0.9f); }),
            0u);
  EXPECT_EQ(count([&](BlockScene* t) {
              const int32_t index = t->AddBlock(block);
              t->AddShape(MeshShape{t->Box({2, 2, 2}, {3, 3, 3})},
                          t->AddMaterial(InterfaceMaterial{}))
                  .media = {index, kNone};
            }),
            0u);
  EXPECT_EQ(count([&](BlockScene* t) {
              t->AddBlock({{-1, -1, 0.9f}, {1, 1, 3}, Rgb::Gray(0.5f), {}});
            }),
            0u);
}

}  // namespace
}  // namespace sheaf::render
