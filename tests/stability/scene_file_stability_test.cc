// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The scenes of scenes/, put through each change that keeps an image (G26), by each technique.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/scene/pbrt/scene_reader.h"
#include "gtest/gtest.h"
#include "tests/stability/scene_changes.h"
#include "tests/support/hard_case.h"
#include "tests/support/light_film_sums.h"
#include "tests/support/long_tests.h"
#include "tests/support/source_path.h"
#include "tests/support/test_scene.h"

namespace sheaf::render {
namespace {

constexpr int32_t kFileWidth = 24;
constexpr int32_t kBlockSide = 8;

struct SceneOfFile {
  const char* name;
  // false: its lens or its lights have lengths of their own.
  bool scales = true;
};
// Those that refine, or read large volumes, take minutes at each change.
constexpr SceneOfFile kScenes[] = {
    {"cornell-box"}, {"caustic"},         {"ajar"},        {"frosted"},
    {"pool"},        {"pool-from-above"}, {"shop-window"}, {"insides"},
    {"fog-room"},    {"principled"},      {"lens", false},
};

struct BlockMean {
  ComponentMean mean;
  std::string name;
};

// The means of the image's blocks.
std::vector<BlockMean> RenderBlocks(const SceneDescription& scene, const FrameSettings& settings,
                                    FileSource& files) {
  CompileLimits limits;
  limits.build_threads = 1;
  const absl::StatusOr<CompiledScenePtr> compiled =
      CompileScene(scene, settings, files, limits, {});
  std::vector<BlockMean> blocks;
  if (!compiled.ok()) {
    ADD_FAILURE() << compiled.status();
    return blocks;
  }
  RenderStats stats;
  BothFilms films{RenderAll(**compiled, &stats), std::nullopt};
  if (HasLightPaths(settings.techniques)) {
    auto light = RenderLightPass(**compiled, settings.window, {0, settings.samples}, {}, &stats);
    EXPECT_TRUE(light.ok()) << light.status();
    if (light.ok()) films.light = *std::move(light);
  }
  EXPECT_TRUE(stats.non_finite.empty());
  const PixelRect window = settings.window;
  for (int32_t y = window.y0; y < window.y1; y += kBlockSide) {
    for (int32_t x = window.x0; x < window.x1; x += kBlockSide) {
      std::vector<size_t> pixels;
      for (int32_t row = y; row < std::min(y + kBlockSide, window.y1); ++row) {
        for (int32_t column = x; column < std::min(x + kBlockSide, window.x1); ++column) {
          pixels.push_back(
              static_cast<size_t>((row - window.y0) * window.Width() + column - window.x0));
        }
      }
      blocks.push_back({MeanOverPixels(films, 1, pixels),
                        absl::StrCat("block at ", x - window.x0, ", ", y - window.y0)});
    }
  }
  return blocks;
}

// Returns the largest relative difference beyond 5 standard errors.
double ExpectSameBlocks(const std::vector<BlockMean>& plain, const std::vector<BlockMean>& changed,
                        double typical) {
  double largest = 0;
  EXPECT_EQ(plain.size(), changed.size());
  for (size_t i = 0; i < std::min(plain.size(), changed.size()); ++i) {
    const ComponentMean &expected = plain[i].mean, &measured = changed[i].mean;
    const double error = std::hypot(expected.standard_error, measured.standard_error);
    const double scale = std::max(expected.value, 0.1 * typical);
    EXPECT_NEAR(measured.value, expected.value, 5 * error + 0.01 * scale) << plain[i].name;
    largest = std::max(largest, (std::fabs(measured.value - expected.value) - 5 * error) / scale);
  }
  return largest;
}

double LargestChange(const SceneOfFile& of, TechniqueSet techniques,
                     const std::vector<Change>& changes) {
  DirectoryFileSource files(sheaf::testing::SourcePath("scenes"));
  auto read = ReadScene(absl::StrCat(of.name, ".pbrt"), files);
  if (!read.ok()) {
    ADD_FAILURE() << read.status();
    return 1;
  }
  RenderSettings wished;
  wished.samples = DrawCount(16, 256);
  wished.techniques = techniques;
  FilmDescription& film = read->scene.film;
  film.height_px = std::max(1, film.height_px * kFileWidth / film.width_px);
  film.width_px = kFileWidth;
  const auto settings = ResolveSettings(read->scene, wished);
  if (!settings.ok()) {
    ADD_FAILURE() << settings.status();
    return 1;
  }
  const std::vector<BlockMean> plain = RenderBlocks(read->scene, *settings, files);
  double typical = 0;
  for (const BlockMean& block : plain) {
    typical += block.mean.value / static_cast<double>(plain.size());
  }
  EXPECT_GT(typical, 0);
  double largest = 0;
  for (const Change& change : changes) {
    if (change.scales && !of.scales) continue;
    SCOPED_TRACE(change.name);
    SceneDescription scene = read->scene;
    change.apply(&scene);
    const std::vector<BlockMean> changed = RenderBlocks(scene, *settings, files);
    largest = std::max(largest, ExpectSameBlocks(plain, changed, typical));
  }
  return largest;
}

// The short form takes one change of each scene in turn.
TEST(SceneFileStability, G26OurScenesKeepTheirImage) {
  const std::vector<Change> all = ImageKeepingChanges();
  double largest = 0;
  size_t turn = 0;
  for (const SceneOfFile& of : kScenes) {
    SCOPED_TRACE(of.name);
    for (const TechniqueSet techniques :
         {TechniqueSet(TechniqueSet::kCamera), TechniqueSet(TechniqueSet::kCameraAndLight)}) {
      SCOPED_TRACE(techniques.Name());
      std::vector<Change> changes = all;
      if (!LongTests()) changes = {all[(5 * turn++) % all.size()]};
      largest = std::max(largest, LargestChange(of, techniques, changes));
    }
  }
  ExpectHardCase({.row = "G26",
                  .figure = "largest relative change of a block of our scenes, beyond its error",
                  .expected = 0,
                  .measured = std::max(0.0, largest),
                  .tolerance = 0.01});
}

}  // namespace
}  // namespace sheaf::render
