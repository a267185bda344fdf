// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests that a training is a pure function of scene and settings, that a field which was sent is as
// good as one that was learned, and that guided frames are one image, however they are cut.
#include "worker/render/guiding_training.h"
#include "worker/render/guiding/training_size.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "tests/support/guided_scenes.h"
#include "worker/render/light_pass.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {
namespace {

using ::testing::HasSubstr;

constexpr int32_t kSizePx = 24;

FrameSettings GuidedSettings() {
  FrameSettings settings = SquareSettings(kSizePx, 16, 5);
  settings.techniques = TechniqueSet::kCameraGuided;
  return settings;
}
CompiledScenePtr CompileTrained(const TestScene& t, const FrameSettings& settings) {
  return Compile(t.scene, settings, kSmallTraining);
}
std::string FieldOf(const CompiledScene& scene, uint32_t threads = 1) {
  absl::StatusOr<std::string> field = TrainGuiding(scene, threads, {}, nullptr);
  EXPECT_TRUE(field.ok()) << field.status();
  return field.ok() ? *std::move(field) : "";
}
std::string FieldFor(const TestScene& t, const FrameSettings& settings, uint32_t threads = 1) {
  return FieldOf(*CompileTrained(t, settings), threads);
}
// The pixels of the part equal those of the whole, in every channel.
void ExpectPartOf(const FilmTile& whole, const FilmTile& part) {
  const PixelRect& of_whole = whole.rect();
  const PixelRect& r = part.rect();
  ASSERT_GT(part.plane_size(), 0u);
  int differing = 0;
  for (int32_t y = r.y0; y < r.y1; ++y) {
    for (int32_t x = r.x0; x < r.x1; ++x) {
      const auto in_part = static_cast<size_t>((y - r.y0) * r.Width() + (x - r.x0));
      const auto in_whole =
          static_cast<size_t>((y - of_whole.y0) * of_whole.Width() + (x - of_whole.x0));
      for (size_t c = 0; c < kFilmChannelCount; ++c) {
        const auto channel = static_cast<FilmChannel>(c);
        differing += part.channel(channel)[in_part] != whole.channel(channel)[in_whole];
      }
    }
  }
  EXPECT_EQ(differing, 0);
}

// --- The training --------------------------------------------------------------------------------

// A lit room, a room lit through a slit, and one with all kinds of media.
std::vector<TestScene> Scenes() {
  return {Diffuse({1}), SlitRoom({1}, 0.3f), Cloudy({1}), Bodies({1})};
}

TEST(GuidingTrainingTest, ThreadsChangeNoByte) {
  for (const TestScene& t : Scenes()) {
    const CompiledScenePtr scene = CompileTrained(t, GuidedSettings());
    const std::string field = FieldOf(*scene, 1);
    EXPECT_GT(field.size(), 1000u);
    EXPECT_TRUE(FieldOf(*scene, 4) == field);
    EXPECT_TRUE(FieldOf(*scene, 3) == field);
  }
}

// Light paths alone are traced for a field of emission alone, and before all else where there is
// more to learn.
FrameSettings EmissionSettings() {
  FrameSettings settings = GuidedSettings();
  settings.techniques = {Technique::kLightPaths, Technique::kEmissionGuiding};
  return settings;
}
TEST(GuidingTrainingTest, EmissionIsLearnedByLightPaths) {
  uint32_t cells = 0;
  for (const TestScene& t : Scenes()) {
    const CompiledScenePtr scene = CompileTrained(t, EmissionSettings());
    RenderStats stats;
    const absl::StatusOr<std::string> field = TrainGuiding(*scene, 1, {}, &stats);
    ASSERT_TRUE(field.ok()) << field.status();
    EXPECT_TRUE(FieldOf(*scene, 4) == *field);
    EXPECT_GE(stats.rays, kSmallTraining.training_paths_first * ((1u << kEmissionIterations) - 1));
    EXPECT_GT(stats.cpu_seconds, 0);
    ASSERT_TRUE(SetGuiding(*scene, *field).ok());
    const LearnedFields& learned = *scene->guiding->fields();
    EXPECT_FALSE(learned.emission.empty());
    cells += learned.emission.cell_count();
    EXPECT_EQ(learned.directions.region_count(), 1u);
    FrameSettings both = EmissionSettings();
    both.techniques = both.techniques.With(Technique::kGuiding);
    const CompiledScenePtr guided = CompileTrained(t, both);
    ASSERT_TRUE(SetGuiding(*guided, FieldOf(*guided)).ok());
    EXPECT_TRUE(guided->guiding->fields()->emission.Encode() == learned.emission.Encode());
    EXPECT_GT(guided->guiding->fields()->directions.region_count(), 1u);
  }
  // Where every path reaches the picture there is nothing to tell apart.
  EXPECT_GT(cells, 16u);
}

// Regions without directions, and a cut of the lights for each.
FrameSettings LightsSettings() {
  FrameSettings settings = GuidedSettings();
  settings.techniques = {Technique::kLearnedLights};
  return settings;
}
TEST(GuidingTrainingTest, LightsAreLearnedAlone) {
  for (const TestScene& t : {ManyLights({1}), Outdoor({1})}) {
    const CompiledScenePtr scene = CompileTrained(t, LightsSettings());
    RenderStats stats;
    const absl::StatusOr<std::string> field = TrainGuiding(*scene, 1, {}, &stats);
    ASSERT_TRUE(field.ok()) << field.status();
    EXPECT_TRUE(FieldOf(*scene, 4) == *field);
    // Few paths: a guided frame traces 17 times as many as the first iteration.
    EXPECT_LT(stats.rays - stats.shadow_rays,
              7 * (kSmallTraining.training_paths_first << kLightsShift));
    EXPECT_GT(stats.cpu_seconds, 0);
    ASSERT_TRUE(SetGuiding(*scene, *field).ok());
    const LearnedFields& learned = *scene->guiding->fields();
    EXPECT_TRUE(learned.Encode() == *field);
    EXPECT_GT(learned.directions.region_count(), 3u);
    EXPECT_EQ(learned.lights.region_count(), learned.directions.region_count());
    EXPECT_EQ(learned.directions.RegionOrNull(0), nullptr);
    // Guided frames learn lights after the directions, and these are as without.
    FrameSettings both = LightsSettings();
    both.techniques = both.techniques.With(Technique::kGuiding);
    const CompiledScenePtr guided = CompileTrained(t, both);
    ASSERT_TRUE(SetGuiding(*guided, FieldOf(*guided, 3)).ok());
    const CompiledScenePtr unlearned = CompileTrained(t, GuidedSettings());
    ASSERT_TRUE(SetGuiding(*unlearned, FieldOf(*unlearned)).ok());
    const LearnedFields &a = *guided->guiding->fields(), &b = *unlearned->guiding->fields();
    EXPECT_TRUE(a.directions.Encode() == b.directions.Encode());
    EXPECT_FALSE(a.lights.Encode() == b.lights.Encode());
  }
}

// A crop, a refinement, another output and the generic variant have the field of the frame.
TEST(GuidingTrainingTest, DependsOnTheFrameAlone) {
  const std::function<void(FrameSettings*)> changes[] = {
      [](FrameSettings* s) {
        s->window = {5, 7, 11, 20};
      },
      [](FrameSettings* s) { s->samples = 4096; },
      [](FrameSettings* s) {
        s->outputs.light_paths = true;
        s->outputs.light_groups = LightPathLayers();
      },
      [](FrameSettings* s) { s->force_generic_variant = true; },
  };
  for (const TestScene& t : Scenes()) {
    for (const FrameSettings& frame : {GuidedSettings(), EmissionSettings(), LightsSettings()}) {
      const std::string field = FieldFor(t, frame);
      for (const auto& change : changes) {
        FrameSettings settings = frame;
        change(&settings);
        EXPECT_TRUE(FieldFor(t, settings) == field);
      }
    }
  }
}

// The training learns contributions after all else.
TEST(GuidingTrainingTest, SplittingAddsToTheField) {
  for (const TestScene& t : Scenes()) {
    FrameSettings settings = GuidedSettings();
    const std::string guided = FieldFor(t, settings);
    settings.techniques = TechniqueSet::kCameraGuidedSplit;
    const std::string split = FieldFor(t, settings);
    EXPECT_GT(split.size(), guided.size());
    EXPECT_TRUE(split.starts_with(guided));
    EXPECT_TRUE(FieldFor(t, settings, 4) == split);
    settings.window = {5, 7, 11, 20};
    EXPECT_TRUE(FieldFor(t, settings) == split);
  }
}

TEST(GuidingTrainingTest, DependsOnWhatPathsDependOn) {
  const TestScene t = SlitRoom({1}, 0.3f);
  const std::string field = FieldFor(t, GuidedSettings());
  const std::function<void(FrameSettings*)> changes[] = {
      [](FrameSettings* s) { s->seed = 1; },
      [](FrameSettings* s) { s->max_depth = 3; },
      [](FrameSettings* s) { s->color = ColorTransport::kSpectral; },
      [](FrameSettings* s) { s->techniques = TechniqueSet::kCameraAndLightGuided; },
  };
  for (const auto& change : changes) {
    FrameSettings settings = GuidedSettings();
    change(&settings);
    EXPECT_FALSE(FieldFor(t, settings) == field);
  }
}

TEST(GuidingTrainingTest, CountsItsRays) {
  const CompiledScenePtr scene = CompileTrained(Diffuse({1}), GuidedSettings());
  RenderStats one, four;
  ASSERT_TRUE(TrainGuiding(*scene, 1, {}, &one).ok());
  ASSERT_TRUE(TrainGuiding(*scene, 4, {}, &four).ok());
  const uint64_t paths = kSmallTraining.training_paths_first *
                         ((1u << kTrainingIterations) - 1 + (1u << kLightsShift));
  EXPECT_GT(one.rays, paths);
  EXPECT_GT(one.rays, one.shadow_rays);
  EXPECT_GT(one.shadow_rays, 0u);
  EXPECT_GT(one.cpu_seconds, 0);
  EXPECT_EQ(one.rays, four.rays);
  EXPECT_EQ(one.shadow_rays, four.shadow_rays);
}

TEST(GuidingTrainingTest, FramesWithoutGuidingAreRefused) {
  FrameSettings settings = GuidedSettings();
  settings.techniques = TechniqueSet::kCamera;
  const CompiledScenePtr scene = CompileTrained(Diffuse({1}), settings);
  const absl::Status trained = TrainGuiding(*scene, 1, {}, nullptr).status();
  EXPECT_EQ(trained.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(trained.message(),
              HasSubstr("must have guiding, emission-guiding or learned-lights"));
  const std::string field = FieldFor(Diffuse({1}), GuidedSettings());
  EXPECT_EQ(SetGuiding(*scene, field).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_TRUE(EnsureGuiding(*scene, {}).ok());
}

TEST(GuidingTrainingTest, StopsOnRequestAndCanBeTriedAgain) {
  const TestScene t = Diffuse({1});
  const CompiledScenePtr scene = CompileTrained(t, GuidedSettings());
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(TrainGuiding(*scene, 2, stop.get_token(), nullptr).status().code(),
            absl::StatusCode::kCancelled);
  EXPECT_EQ(EnsureGuiding(*scene, stop.get_token()).code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(RenderTilePass(*scene, {0, 0, 4, 4}, {0, 1}, stop.get_token(), nullptr).status().code(),
            absl::StatusCode::kCancelled);
  EXPECT_EQ(scene->guiding->fields(), nullptr);
  ASSERT_TRUE(EnsureGuiding(*scene, {}).ok());
  EXPECT_TRUE(scene->guiding->fields()->Encode() == FieldFor(t, GuidedSettings()));
}

// A request while the training runs: no field is left half learned.
TEST(GuidingTrainingTest, StopsWhileItRuns) {
  const CompiledScenePtr scene =
      Compile(Diffuse({1}).scene, GuidedSettings(), {.training_paths_first = uint64_t{1} << 28});
  std::stop_source stop;
  std::jthread asks([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    stop.request_stop();
  });
  EXPECT_EQ(EnsureGuiding(*scene, stop.get_token()).code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(scene->guiding->fields(), nullptr);
}

// --- Fields that were sent -----------------------------------------------------------------------

TEST(GuidingTrainingTest, SentFieldsGiveTheSameBits) {
  for (const TestScene& t : Scenes()) {
    const CompiledScenePtr learns = CompileTrained(t, GuidedSettings()),
                           receives = CompileTrained(t, GuidedSettings());
    ASSERT_TRUE(SetGuiding(*receives, FieldOf(*learns)).ok());
    const FilmTile learned = RenderAll(*learns);
    EXPECT_TRUE(RenderAll(*receives) == learned);
    EXPECT_EQ(learns->guiding->fields()->Encode(), receives->guiding->fields()->Encode());
  }
}

TEST(GuidingTrainingTest, SentFieldsAreUsedAndTheFirstOneStays) {
  const TestScene t = SlitRoom({1}, 0.3f);
  FrameSettings other = GuidedSettings();
  other.seed = 9;
  const std::string own = FieldFor(t, GuidedSettings()), foreign = FieldFor(t, other);
  const CompiledScenePtr scene = CompileTrained(t, GuidedSettings());
  ASSERT_TRUE(SetGuiding(*scene, foreign).ok());
  ASSERT_TRUE(SetGuiding(*scene, own).ok());
  ASSERT_TRUE(EnsureGuiding(*scene, {}).ok());
  EXPECT_EQ(scene->guiding->fields()->Encode(), foreign);
  EXPECT_FALSE(RenderAll(*scene) == RenderAll(*CompileTrained(t, GuidedSettings())));
}

TEST(GuidingTrainingTest, DamagedFieldsAreRefused) {
  const TestScene t = Diffuse({1});
  const FrameSettings settings = EmissionSettings();
  const std::string field = FieldFor(t, settings);
  const CompiledScenePtr scene = CompileTrained(t, settings);
  std::string other_start = field;
  other_start[0] ^= 1;
  for (const std::string& damaged :
       {std::string(), field.substr(0, 1), field.substr(0, field.size() / 2),
        field.substr(0, field.size() - 1), field + '\0', other_start,
        std::string(field.size(), '\xff')}) {
    const absl::Status refused = SetGuiding(*scene, damaged);
    EXPECT_EQ(refused.code(), absl::StatusCode::kDataLoss) << refused;
    EXPECT_EQ(scene->guiding->fields(), nullptr);
  }
  ASSERT_TRUE(SetGuiding(*scene, field).ok());
  EXPECT_TRUE(scene->guiding->fields()->Encode() == field);
}

// --- One image -----------------------------------------------------------------------------------

TEST(GuidedFrameTest, CropsAreThatPartOfTheWhole) {
  for (const TechniqueSet techniques :
       {TechniqueSet::kCameraGuided, TechniqueSet::kCameraAndLightGuided,
        TechniqueSet::kCameraGuidedSplit, EmissionSettings().techniques}) {
    FrameSettings settings = GuidedSettings();
    settings.techniques = techniques;
    for (const TestScene& t : {SlitRoom({1}, 0.3f), Cloudy({1})}) {
      const CompiledScenePtr whole = CompileTrained(t, settings);
      FrameSettings cropped = settings;
      cropped.window = {5, 7, 16, 20};
      const CompiledScenePtr crop = CompileTrained(t, cropped);
      const FilmTile image = RenderAll(*whole);
      EXPECT_GT(MeanOf(image).mean.g, 0);
      ExpectPartOf(image, RenderAll(*crop));
      if (!HasLightPaths(techniques)) continue;
      const auto of_whole = RenderLightPass(*whole, settings.window, {0, 2}, {}, nullptr),
                 of_crop = RenderLightPass(*crop, cropped.window, {0, 2}, {}, nullptr);
      ASSERT_TRUE(of_whole.ok() && of_crop.ok());
      ExpectPartOf(*of_whole, *of_crop);
    }
  }
}

// Tiles, passes and threads, of which the first two meet in a training.
TEST(GuidedFrameTest, TilesPassesAndThreadsChangeNoBit) {
  const FrameSettings settings = GuidedSettings();
  const TestScene t = SlitRoom({1}, 0.3f);
  const FilmTile whole = RenderAll(*CompileTrained(t, settings));
  for (const int32_t size : {5, 12}) {
    const CompiledScenePtr scene = CompileTrained(t, settings);
    const std::vector<PixelRect> tiles = CutTiles(settings.window, size);
    std::vector<FilmTile> parts(tiles.size());
    {
      std::vector<std::jthread> threads;
      for (size_t first = 0; first < 2; ++first) {
        threads.emplace_back([&, first] {
          for (size_t i = first; i < tiles.size(); i += 2) {
            auto low = RenderTilePass(*scene, tiles[i], {0, 8}, {}, nullptr);
            auto high = RenderTilePass(*scene, tiles[i], {8, 8}, {}, nullptr);
            if (low.ok() && high.ok()) parts[i] = MergeSiblings(*low, *high);
          }
        });
      }
    }
    for (const FilmTile& part : parts) ExpectPartOf(whole, part);
  }
}

TEST(GuidedFrameTest, GenericVariantKeepsTheBits) {
  for (const TestScene& t : Scenes()) {
    FrameSettings settings = GuidedSettings();
    const CompiledScenePtr planned = CompileTrained(t, settings);
    settings.force_generic_variant = true;
    const CompiledScenePtr forced = CompileTrained(t, settings);
    EXPECT_EQ(PlanOf(*forced).variant_name, "generic");
    EXPECT_TRUE(RenderAll(*planned) == RenderAll(*forced)) << PlanOf(*planned).variant_name;
  }
  EXPECT_EQ(PlanOf(*CompileTrained(SlitRoom({1}, 0.3f), GuidedSettings())).variant_name,
            "guided common");
}

}  // namespace
}  // namespace sheaf::render
