// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests that light paths whose beginnings are guided find the light that others find, find it with
// less noise where few paths reach the picture, and change nothing where nothing was learned.
#include <gtest/gtest.h>

#include <array>
#include <string>
#include <vector>

#include "tests/support/emissive_scenes.h"
#include "tests/support/guided_scenes.h"
#include "tests/support/light_film_sums.h"
#include "tests/support/technique_agreement.h"
#include "worker/render/guiding_training.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {
namespace {

using sheaf::testing::Bias;
using sheaf::testing::EstimatesOfTiles;
using sheaf::testing::ExpectAgreement;
using sheaf::testing::kSizePx;
using sheaf::testing::Samples;
using sheaf::testing::TilePair;
using testing::Estimate;

constexpr Tint kColored{1};
constexpr TechniqueSet kBoth = TechniqueSet::kCameraAndLight;
const TechniqueSet kGuidedBoth = kBoth.With(Technique::kEmissionGuiding),
                   kGuidedAlone = TechniqueSet::kLight.With(Technique::kEmissionGuiding),
                   kAllGuided = kGuidedBoth.With(Technique::kGuiding);

FrameSettings SettingsFor(TechniqueSet techniques, uint64_t samples, uint64_t seed,
                          int32_t size_px = kSizePx) {
  FrameSettings settings = SquareSettings(size_px, samples, 4);
  settings.seed = seed;
  settings.techniques = techniques;
  return settings;
}

std::vector<Estimate> Render(const TestScene& scene, const FrameSettings& settings) {
  const BothFilms films = RenderBothFilms(*Compile(scene.scene, settings, kSmallTraining));
  return EstimatesOfTiles(
      kReplicateCount,
      [&](uint32_t r, size_t pixel) {
        return films.Mean(r, 0, pixel) + films.Mean(r, 1, pixel) + films.Mean(r, 2, pixel);
      },
      [](uint32_t, size_t) { return 1.0; });
}

void ExpectAgree(const std::string& name, const std::vector<TestScene>& scenes, double bias,
                 TechniqueSet a, TechniqueSet b, uint64_t samples,
                 ColorTransport color = ColorTransport::kRgb) {
  std::vector<TilePair> tiles;
  uint64_t seed = 300;
  for (const TestScene& scene : scenes) {
    FrameSettings of_a = SettingsFor(a, Samples(samples), seed++),
                  of_b = SettingsFor(b, Samples(samples), seed++);
    of_a.color = of_b.color = color;
    const std::vector<Estimate> estimates_a = Render(scene, of_a),
                                estimates_b = Render(scene, of_b);
    for (size_t tile = 0; tile < estimates_a.size(); ++tile) {
      tiles.push_back({estimates_a[tile], estimates_b[tile]});
    }
  }
  ExpectAgreement(name, bias, tiles);
}

// A room that the sky lights through a window, seen from within; around it lies a larger plain,
// which the picture does not show.
TestScene WindowRoom() {
  TestScene t({-0.2, 1.1, -2.9}, {0.1, 0.8, 0}, 55);
  t.ConstantEnvironment({6, 8, 10});
  const int32_t wall = t.Diffuse({0.6f, 0.55f, 0.5f});
  const auto add = [&](Vec3f a, Vec3f b, Vec3f c, Vec3f d) {
    t.AddShape(MeshShape{t.Quad(a, b, c, d)}, wall);
  };
  add({-8, 0, -8}, {-8, 0, 8}, {8, 0, 8}, {8, 0, -8});
  add({-2, 2.5f, -3}, {-2, 2.5f, 2}, {2, 2.5f, 2}, {2, 2.5f, -3});
  add({-2, 0, 2}, {-2, 2.5f, 2}, {2, 2.5f, 2}, {2, 0, 2});
  add({-2, 0, -3}, {-2, 2.5f, -3}, {2, 2.5f, -3}, {2, 0, -3});
  add({-2, 0, -3}, {-2, 2.5f, -3}, {-2, 2.5f, 2}, {-2, 0, 2});
  // The wall with the window, x = 2: below, above and beside it.
  add({2, 0, -3}, {2, 0.8f, -3}, {2, 0.8f, 2}, {2, 0, 2});
  add({2, 2.2f, -3}, {2, 2.5f, -3}, {2, 2.5f, 2}, {2, 2.2f, 2});
  add({2, 0.8f, -3}, {2, 2.2f, -3}, {2, 2.2f, -1}, {2, 0.8f, -1});
  add({2, 0.8f, 1}, {2, 2.2f, 1}, {2, 2.2f, 2}, {2, 0.8f, 2});
  t.AddShape(kBall, t.Diffuse({0.4f, 0.6f, 0.3f}), TranslateMatrix({-0.6, 0.6, 0.6}));
  return t;
}

TEST(EmissionGuidingTest, BothKindsFindWhatTheyFindUnguided) {
  ExpectAgree("guided emission", {Diffuse(kColored), Outdoor(kColored), ManyLights(kColored)},
              Bias(), kBoth, kGuidedBoth, 64);
}
TEST(EmissionGuidingTest, BothKindsFindTheSkyThroughAWindow) {
  ExpectAgree("guided emission, window", {WindowRoom()}, 5 * Bias(), TechniqueSet::kCamera,
              kGuidedBoth, 256);
}
TEST(EmissionGuidingTest, LightPathsFindWhatTheCameraFinds) {
  ExpectAgree("guided emission alone", {Diffuse(kColored), Outdoor(kColored)}, 4 * Bias(),
              TechniqueSet::kCamera, kGuidedAlone, 128);
}
TEST(EmissionGuidingTest, MediaAndSpectraAgree) {
  ExpectAgree("guided emission, spectra", {Hazy(kColored), Lanterns(kColored)}, 2 * Bias(), kBoth,
              kGuidedBoth, 64, ColorTransport::kSpectral);
}
TEST(EmissionGuidingTest, CameraPathsMayBeGuidedToo) {
  ExpectAgree("all guided", {Diffuse(kColored)}, Bias(), kBoth, kAllGuided, 64);
}

// --- Noise ---------------------------------------------------------------------------------------

double ErrorOfLight(const TestScene& scene, TechniqueSet techniques) {
  const FrameSettings settings = SettingsFor(techniques, 64, 5, 16);
  const BothFilms films =
      RenderBothFilms(*Compile(scene.scene, settings, {.training_paths_first = 65536}));
  std::array<double, kReplicateCount> means{};
  double squares = 0;
  for (size_t pixel = 0; pixel < films.camera.plane_size(); ++pixel) {
    double mean = 0;
    for (uint32_t r = 0; r < kReplicateCount; ++r) {
      means[r] = films.Mean(r, 1, pixel);
      mean += means[r] / kReplicateCount;
    }
    for (const double m : means) squares += (m - mean) * (m - mean);
  }
  return squares;
}

// By light paths alone, of which few find the window.
TEST(EmissionGuidingTest, FewPathsMissThePicture) {
  const double unguided = ErrorOfLight(WindowRoom(), TechniqueSet::kLight),
               guided = ErrorOfLight(WindowRoom(), kGuidedAlone);
  EXPECT_LT(guided, 0.4 * unguided) << guided << " and " << unguided;
}

// --- Nothing to learn ----------------------------------------------------------------------------

TEST(EmissionGuidingTest, NothingLearnedChangesNoBit) {
  // The lamp is behind the wall that the camera sees.
  TestScene t({0, 1, -3}, {0, 1, 0}, 40);
  t.AddShape(MeshShape{t.Quad({-9, -9, 0}, {-9, 9, 0}, {9, 9, 0}, {9, -9, 0})},
             t.Diffuse({0.5f, 0.5f, 0.5f}));
  t.AddShape(MeshShape{t.Quad({-1, 0, 1}, {1, 0, 1}, {1, 2, 1}, {-1, 2, 1})}, t.Diffuse({}))
      .area_light = t.AreaLight({6, 5, 4});
  const CompiledScenePtr guided =
      Compile(t.scene, SettingsFor(kGuidedBoth, 16, 5, 16), kSmallTraining);
  const BothFilms films = RenderBothFilms(*guided);
  EXPECT_TRUE(guided->guiding->fields()->emission.empty());
  const BothFilms plain = RenderBothFilms(*Compile(t.scene, SettingsFor(kBoth, 16, 5, 16)));
  EXPECT_TRUE(films.camera == plain.camera);
  EXPECT_TRUE(*films.light == *plain.light);
}

}  // namespace
}  // namespace sheaf::render
