// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Kinds of paths: they add up to the image, match their names, and account for its noise.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <string>

#include "common/film/film.h"
#include "common/film/light_path_kind.h"
#include "tests/support/emissive_scenes.h"
#include "tests/support/light_film_sums.h"
#include "tests/support/technique_scenes.h"
#include "tests/support/test_scene.h"
#include "worker/render/integrator/path_history.h"
#include "worker/render/path_noise.h"

namespace sheaf::render {
namespace {

constexpr int32_t kFrameSizePx = 16;
constexpr uint64_t kSamples = 64;

FrameSettings PathSettings(int32_t depth) {
  FrameSettings settings = SquareSettings(kFrameSizePx, kSamples, depth);
  settings.outputs.AddLightPaths();
  return settings;
}

FrameImage RenderFrameImage(const SceneDescription& scene, const FrameSettings& settings) {
  const CompiledScenePtr compiled = Compile(scene, settings);
  FrameImage image =
      MakeFrameImage(settings.window, settings.width_px, settings.height_px, settings.outputs);
  DevelopTile(RenderAll(*compiled), &image);
  return image;
}

double SumOf(const FrameImage& image, const std::string& channel) {
  const std::vector<float>* plane = image.Find(channel);
  EXPECT_NE(plane, nullptr) << channel;
  double sum = 0;
  for (const float v : *plane) sum += static_cast<double>(v);
  return sum;
}

// The sum of green over the image for every kind; expects that the kinds add up in every pixel.
std::map<std::string, double> KindsOf(const SceneDescription& scene, int32_t depth) {
  const FrameImage image = RenderFrameImage(scene, PathSettings(depth));
  for (const std::string component : {".R", ".G", ".B"}) {
    const std::vector<float>& whole = *image.Find(component.substr(1));
    for (size_t p = 0; p < whole.size(); ++p) {
      double sum = 0;
      for (const LightPathName& kind : kLightPathNames) {
        sum += static_cast<double>((*image.Find(kind.name + component))[p]);
      }
      EXPECT_NEAR(sum, whole[p], 1e-5 * static_cast<double>(whole[p]) + 1e-7);
    }
  }
  std::map<std::string, double> kinds;
  for (const LightPathName& kind : kLightPathNames) {
    kinds[kind.name] = SumOf(image, std::string(kind.name) + ".G");
  }
  return kinds;
}

TestScene RoomWithGlass() {
  TestScene t = LitRoom(1);
  DielectricMaterial glass;
  t.AddShape(SphereShape{0.3f, -0.3f, 0.3f, 360}, t.AddMaterial(glass),
             TranslateMatrix({-0.3, -0.4, 0.3}));
  return t;
}

// Green of the image with at most one scattering.
double GreenOfDepthOne(const SceneDescription& scene) {
  return SumOf(RenderFrameImage(scene, SquareSettings(kFrameSizePx, kSamples, 1)), "G");
}

TEST(LightPathsTest, RoughRoomHasSeenDirectAndIndirectLight) {
  const TestScene t = LitRoom(1);
  std::map<std::string, double> kinds = KindsOf(t.scene, 5);
  const double first = kinds["emission"] + kinds["direct"];
  EXPECT_NEAR(first, GreenOfDepthOne(t.scene), 1e-4 * first);
  EXPECT_GT(kinds["indirect"], 0.05 * first);
  for (const char* none : {"specular-emission", "caustic", "volume-single", "volume-multiple",
                           "subsurface", "volume-emission"}) {
    EXPECT_EQ(kinds[none], 0) << none;
  }
  EXPECT_EQ(KindsOf(t.scene, 1)["indirect"], 0);
}

TEST(LightPathsTest, GlassCausesCausticsAndShowsEmitters) {
  std::map<std::string, double> kinds = KindsOf(RoomWithGlass().scene, 8);
  EXPECT_GT(kinds["caustic"], 0);
  EXPECT_GT(kinds["specular-emission"], 0);
  EXPECT_EQ(kinds["volume-multiple"], 0);
}

TEST(LightPathsTest, FogScattersOnceAndRepeatedly) {
  const TestScene t = Foggy(Tint{1});
  std::map<std::string, double> kinds = KindsOf(t.scene, 5);
  const double first = kinds["emission"] + kinds["direct"] + kinds["volume-single"];
  EXPECT_NEAR(first, GreenOfDepthOne(t.scene), 1e-4 * first);
  EXPECT_GT(kinds["volume-single"], 0);
  EXPECT_GT(kinds["volume-multiple"], 0);
}

TEST(LightPathsTest, VolumeEmissionComesFromMedia) {
  std::map<std::string, double> kinds = KindsOf(Burning(Tint{1}).scene, 5);
  EXPECT_GT(kinds["volume-emission"], 0);
}

// Paths that begin in media bring their light to that layer, or to the group of media.
TEST(LightPathsTest, PathsFromMediaBringTheirEmission) {
  FrameSettings settings = PathSettings(4);
  settings.techniques = TechniqueSet::kLight;
  const auto light_image = [&](const TestScene& t) {
    const BothFilms films = RenderBothFilms(*Compile(t.scene, settings));
    FrameImage image =
        MakeFrameImage(settings.window, settings.width_px, settings.height_px, settings.outputs);
    DevelopTile(*films.light, &image);
    return image;
  };
  const FrameImage lamps = light_image(Lamps(Tint{1}));
  EXPECT_GT(SumOf(lamps, "G"), 0);
  EXPECT_NEAR(SumOf(lamps, "volume-emission.G"), SumOf(lamps, "G"), 1e-4 * SumOf(lamps, "G"));
  settings.outputs = {};
  settings.outputs.light_groups = {kDefaultLightGroup, "lamp"};
  TestScene t = SmokelessRoom();
  t.scene.area_lights[0].group = "lamp";
  const FrameImage room = light_image(t);
  const double of_media = SumOf(room, std::string(kDefaultLightGroup) + ".G");
  EXPECT_GT(of_media, 0.05 * SumOf(room, "G"));
  EXPECT_GT(SumOf(room, "lamp.G"), 0.05 * SumOf(room, "G"));
  EXPECT_NEAR(of_media + SumOf(room, "lamp.G"), SumOf(room, "G"), 1e-4 * SumOf(room, "G"));
}

TEST(LightPathsTest, HistoryDistinguishesKinds) {
  PathHistory seen;
  EXPECT_EQ(seen.KindAtHit(), LightPathKind::kEmission);
  EXPECT_EQ(seen.KindFromSurface(), LightPathKind::kDirect);
  EXPECT_EQ(seen.KindFromMedium(), LightPathKind::kVolumeSingle);
  PathHistory mirrored = seen;
  mirrored.AddSurface(true);
  EXPECT_EQ(mirrored.KindAtHit(), LightPathKind::kSpecularEmission);
  EXPECT_EQ(mirrored.KindFromSurface(), LightPathKind::kDirect);
  PathHistory rough = mirrored;
  rough.AddSurface(false);
  EXPECT_EQ(rough.KindAtHit(), LightPathKind::kDirect);
  EXPECT_EQ(rough.KindFromSurface(), LightPathKind::kIndirect);
  EXPECT_EQ(rough.KindFromMedium(), LightPathKind::kVolumeMultiple);
  PathHistory caustic = rough;
  caustic.AddSurface(true);
  EXPECT_EQ(caustic.KindAtHit(), LightPathKind::kCaustic);
  EXPECT_EQ(caustic.KindFromSurface(), LightPathKind::kIndirect);
  PathHistory beneath = rough;
  beneath.AddMedium(true);
  beneath.AddSurface(false);
  EXPECT_EQ(beneath.KindAtHit(), LightPathKind::kSubsurface);
}

TEST(LightPathsTest, GroupsAndPathsExcludeEachOther) {
  RenderSettings asked;
  asked.light_groups = asked.light_paths = true;
  TestScene t = LitRoom(1);
  t.scene.film.width_px = t.scene.film.height_px = kFrameSizePx;
  EXPECT_FALSE(ResolveSettings(t.scene, asked).ok());
  asked.light_groups = false;
  const absl::StatusOr<FrameSettings> settings = ResolveSettings(t.scene, asked);
  ASSERT_TRUE(settings.ok());
  EXPECT_EQ(settings->outputs.light_groups.size(), kLightPathKindCount);
}

PathNoise NoiseOf(const SceneDescription& scene, int32_t depth, uint64_t samples) {
  const CompiledScenePtr compiled = Compile(scene, PathSettings(depth));
  const absl::StatusOr<PathNoiseSums> sums =
      PathNoiseSums::Of(*compiled, {0, 0, kFrameSizePx, kFrameSizePx}, samples, 0.01);
  EXPECT_TRUE(sums.ok()) << sums.status();
  return sums->Fractions();
}

TEST(PathNoiseTest, FractionsAddUp) {
  const PathNoise noise = NoiseOf(RoomWithGlass().scene, 8, kSamples);
  double light = 0, variance = 0;
  for (const PathFractions& kind : noise.kinds) {
    light += kind.light;
    variance += kind.variance;
    EXPECT_LE(kind.one_replicate, 1);
  }
  EXPECT_NEAR(light, 1, 1e-9);
  EXPECT_NEAR(variance, 1, 1e-9);
}

// Caustics of a small light consist of rare bright samples: little light, but most of the noise.
TEST(PathNoiseTest, CausticsDominateTheNoise) {
  TestScene t = RoomWithGlass();
  t.scene.area_lights[0].radiance.rgb = Rgb::Gray(50);
  t.scene.meshes.back().positions = {
      {-0.1f, 0.99f, -0.1f}, {0.1f, 0.99f, -0.1f}, {0.1f, 0.99f, 0.1f}, {-0.1f, 0.99f, 0.1f}};
  const PathNoise noise = NoiseOf(t.scene, 8, kSamples);
  const PathFractions& caustic = noise.kinds[static_cast<size_t>(LightPathKind::kCaustic)];
  EXPECT_LT(caustic.light, 0.3);
  EXPECT_GT(caustic.variance, 0.7);
  EXPECT_GT(caustic.one_replicate, 0.5);
  const PathNoise plain = NoiseOf(LitRoom(1).scene, 5, kSamples);
  EXPECT_LT(plain.one_replicate_fraction, 0.5);
  EXPECT_EQ(plain.kinds[static_cast<size_t>(LightPathKind::kCaustic)].variance, 0);
}

}  // namespace
}  // namespace sheaf::render
