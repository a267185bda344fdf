// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame/frame_merge.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "common/film/film_test_samples.h"
#include "common/film/light/light_pass_accumulator.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

constexpr PixelRect kWindow{0, 0, 40, 24};
constexpr uint64_t kSamples = 32;

FrameSpec SpecOf(TechniqueSet techniques) {
  FrameSpec spec;
  spec.settings.width_px = kWindow.x1;
  spec.settings.height_px = kWindow.y1;
  spec.settings.window = kWindow;
  spec.settings.samples = kSamples;
  spec.settings.techniques = techniques;
  return spec;
}

// Light on the left half of the window.
FilmTile LightPart(SampleBlock block) {
  FilmTile tile(kWindow, block);
  LightPassAccumulator film(&tile);
  for (uint64_t pass = block.first; pass < block.End(); ++pass) {
    for (int32_t i = 0; i < 20 * 24; ++i) {
      const float value = HashToUnit(pass * 1024 + static_cast<uint64_t>(i));
      film.Add(i % 20, i / 20, {value, 2 * value, value}, 1, std::nullopt);
    }
    film.EndPass();
  }
  film.Finish();
  return tile;
}

struct Part {
  uint32_t tile = 0;
  FilmTile sums;
};

// All parts of the frame, with blocks of block_samples samples.
std::vector<Part> PartsOf(const CellGrid& grid, uint64_t block_samples, uint64_t block_passes) {
  std::vector<Part> parts;
  for (uint32_t tile = 0; tile < grid.tile_count(); ++tile) {
    const bool is_light = grid.KindOf(tile) == TaskKind::kLight;
    for (const SampleBlock& block :
         CutSamples(0, kSamples, is_light ? block_passes : block_samples)) {
      parts.push_back({tile, is_light ? LightPart(block) : MakeTestTile(grid.RectOf(tile), block)});
    }
  }
  return parts;
}

class FrameMergeTest : public ::testing::Test {
 protected:
  std::unique_ptr<FrameMerge> MergeOf(TechniqueSet techniques) {
    const FrameSpec spec = SpecOf(techniques);
    CellGrid grid(spec, {.tile_size_px = 16});
    std::vector<uint64_t> samples(grid.cells().size(), kSamples);
    return std::make_unique<FrameMerge>(spec, std::move(grid), std::move(samples), &budget_);
  }
  // Inserts parts in a random order, looking at the image now and then.
  std::unique_ptr<FrameMerge> Merged(TechniqueSet techniques, uint64_t block_samples,
                                     uint64_t block_passes, uint32_t seed) {
    std::unique_ptr<FrameMerge> merge = MergeOf(techniques);
    std::vector<Part> parts = PartsOf(merge->grid(), block_samples, block_passes);
    std::mt19937 bits(seed);
    std::shuffle(parts.begin(), parts.end(), bits);
    for (Part& part : parts) {
      merge->Insert(part.tile, {std::move(part.sums), 1});
      if (bits() % 3 == 0) merge->Refresh();
    }
    EXPECT_TRUE(merge->AllDeveloped());
    return merge;
  }

  MergeBudget budget_{uint64_t{1} << 40};
};

float At(const FrameImage& image, const char* channel, int32_t x, int32_t y) {
  return (*image.Find(channel))[image.window.IndexOf(x, y)];
}

TEST_F(FrameMergeTest, TheImageIsOneWhateverTheOrderAndTheTasks) {
  const std::string digest = ImageDigest(Merged(TechniqueSet::kCameraAndLight, 32, 16, 1)->image());
  EXPECT_EQ(ImageDigest(Merged(TechniqueSet::kCameraAndLight, 4, 1, 2)->image()), digest);
  EXPECT_EQ(ImageDigest(Merged(TechniqueSet::kCameraAndLight, 16, 8, 3)->image()), digest);
  EXPECT_NE(ImageDigest(Merged(TechniqueSet::kCamera, 32, 16, 1)->image()), digest);
}

// A certified bound needs a maximum of samples; it does not depend on the tasks.
TEST_F(FrameMergeTest, CertifiesErrorsOfBoundedSamples) {
  const auto certified = [this](float most, uint64_t block_samples) {
    FrameSpec spec = SpecOf(TechniqueSet::kCamera);
    spec.settings.max_component_value = most;
    spec.settings.color = ColorTransport::kRgb;
    CellGrid grid(spec, {.tile_size_px = 16});
    FrameMerge merge(spec, std::move(grid), std::vector<uint64_t>(6, kSamples), &budget_);
    for (uint32_t i = 0; i < merge.tile_count(); ++i) {
      for (const SampleBlock& block : CutSamples(0, kSamples, block_samples)) {
        FilmTile tile(merge.grid().RectOf(i), block);
        PixelAccumulator accumulator(&tile);
        const PixelRect& rect = tile.rect();
        for (int32_t p = 0; p < rect.PixelCount(); ++p) {
          const int32_t x = rect.x0 + p % rect.Width(), y = rect.y0 + p / rect.Width();
          accumulator.Begin(x, y);
          for (uint64_t n = block.first; n < block.End(); ++n) {
            const uint64_t key =
                (n * 64 + static_cast<uint64_t>(y)) * 64 + static_cast<uint64_t>(x);
            accumulator.Add(n, {.radiance = Rgb::Gray(HashToUnit(key))});
          }
          accumulator.End();
        }
        merge.Insert(i, {std::move(tile), 1});
      }
    }
    EXPECT_TRUE(merge.AllDeveloped());
    // Nothing but the certificate is kept.
    EXPECT_EQ(budget_.bytes() > 0, most > 0);
    EXPECT_LE(budget_.bytes(), 40u * static_cast<uint64_t>(spec.settings.window.PixelCount()));
    return merge.CertifiedError();
  };
  const double bound = certified(2, kSamples);
  // The error is 1 / (12 * 32) over 1 / 4 and a hundredth of it.
  EXPECT_GT(bound, 1.0 / (12 * 32 * 0.2525));
  EXPECT_LT(bound, 10);
  EXPECT_EQ(certified(2, 4), bound);
  EXPECT_GT(certified(4, kSamples), bound);
  EXPECT_EQ(certified(0, kSamples), 0);
  EXPECT_EQ(budget_.bytes(), 0u);
}

TEST_F(FrameMergeTest, LightIsAddedToTheCamerasImage) {
  const auto camera = Merged(TechniqueSet::kCamera, 32, 16, 1);
  const auto both = Merged(TechniqueSet::kCameraAndLight, 32, 16, 1);
  double mean = 0;
  for (uint64_t pass = 0; pass < kSamples; ++pass) {
    mean += double{HashToUnit(pass * 1024 + 3 * 20 + 5)} / kSamples;
  }
  EXPECT_NEAR(At(both->image(), "R", 5, 3) - At(camera->image(), "R", 5, 3), mean,
              1e-6 * std::max(1.0F, std::fabs(At(camera->image(), "R", 5, 3))));
  EXPECT_GT(At(both->image(), "stderr.R", 5, 3), At(camera->image(), "stderr.R", 5, 3));
  EXPECT_EQ(At(both->image(), "stderr.R", 30, 3), At(camera->image(), "stderr.R", 30, 3));
  EXPECT_EQ(At(both->image(), "samples", 5, 3), kSamples);
  EXPECT_TRUE(both->Flip().has_value());
}

// Without light passes, a preview would be too dark.
TEST_F(FrameMergeTest, NothingIsShownBeforeTheFirstLightPass) {
  const auto merge = MergeOf(TechniqueSet::kCameraAndLight);
  const uint32_t light = *merge->grid().light_tile();
  merge->Insert(0, {MakeTestTile(merge->grid().RectOf(0), {0, 16}), 1});
  EXPECT_TRUE(merge->Refresh().empty());
  EXPECT_EQ(merge->FewestSamples(), 0u);
  merge->Insert(light, {LightPart({0, 4}), 1});
  // The light is that of the whole image.
  EXPECT_EQ(merge->Refresh().size(), merge->grid().tiles().size());
  EXPECT_GT(At(merge->image(), "R", 18, 20), 0);
  EXPECT_GT(At(merge->image(), "samples", 2, 2), 0);
  merge->Insert(1, {MakeTestTile(merge->grid().RectOf(1), {0, 16}), 1});
  EXPECT_EQ(merge->Refresh(), std::vector<uint32_t>{1});
  EXPECT_EQ(merge->SamplesOfCells().size(), merge->grid().tiles().size());
}

TEST_F(FrameMergeTest, ATileIsRebuiltWithAllOfItsPassesOnly) {
  const auto merge = Merged(TechniqueSet::kCameraAndLight, 32, 16, 4);
  const std::string digest = ImageDigest(merge->image());
  const uint32_t light = *merge->grid().light_tile();
  merge->MarkOnDisk(light);
  EXPECT_FALSE(merge->AllDeveloped());
  auto trees = merge->MakeTrees(light);
  ASSERT_TRUE(trees->Insert(LightPart({16, 16}), 1).ok());
  EXPECT_FALSE(merge->Rebuild(light, std::move(trees)).ok());
  trees = merge->MakeTrees(light);
  for (const SampleBlock& block : CutSamples(0, kSamples, 2)) {
    ASSERT_TRUE(trees->Insert(LightPart(block), 1).ok());
  }
  ASSERT_TRUE(merge->Rebuild(light, std::move(trees)).ok());
  EXPECT_TRUE(merge->AllDeveloped());
  EXPECT_EQ(ImageDigest(merge->image()), digest);
}

// Light passes follow the cell with most samples.
TEST_F(FrameMergeTest, MoreSamplesOfACellNeedMoreLightPasses) {
  const auto merge = Merged(TechniqueSet::kCameraAndLight, 32, 16, 5);
  merge->Grow(2, 2 * kSamples);
  EXPECT_FALSE(merge->Developed(2));
  EXPECT_FALSE(merge->Developed(*merge->grid().light_tile()));
  EXPECT_TRUE(merge->Developed(1));
}

}  // namespace
}  // namespace sheaf::coordinator
