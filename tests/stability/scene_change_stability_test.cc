// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of whole scenes, named as in the catalogue (G19): turned, mirrored, scaled, moved,
// given twice, in reverse order or with finer triangles, a scene has the same image, by each
// technique.
#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "common/math/transform.h"
#include "gtest/gtest.h"
#include "tests/stability/scene_changes.h"
#include "tests/support/hard_case.h"
#include "tests/support/light_film_sums.h"
#include "tests/support/long_tests.h"
#include "tests/support/technique_scenes.h"

namespace sheaf::render {
namespace {

constexpr int32_t kPixels = 16, kBlock = 8;

// A table with a glass on it, below a ceiling with a lamp in its plane, in front of a wall with a
// decal.
TestScene FlushRoom() {
  TestScene t({0, 1, -3.2}, {0, 0.6, 0}, 36);
  t.AddShape(MeshShape{t.Quad({-2, 0, -2}, {-2, 0, 2}, {2, 0, 2}, {2, 0, -2})},
             t.Diffuse({0.6f, 0.5f, 0.4f}));
  t.AddShape(MeshShape{t.Quad({-2, 0, 2}, {-2, 3, 2}, {2, 3, 2}, {2, 0, 2})},
             t.Diffuse({0.3f, 0.5f, 0.7f}));
  t.AddShape(
      MeshShape{t.Quad({-0.9f, 0.3f, 2}, {-0.9f, 1.6f, 2}, {0.4f, 1.6f, 2}, {0.4f, 0.3f, 2})},
      t.Diffuse({0.8f, 0.2f, 0.1f}));
  t.AddShape(MeshShape{t.Quad({-2, 2.5f, -2}, {2, 2.5f, -2}, {2, 2.5f, 2}, {-2, 2.5f, 2})},
             t.Diffuse({0.7f, 0.7f, 0.7f}));
  AddPointEmitter(&t, {1}, 0.9f);
  DielectricMaterial glass;
  glass.eta.mean = 1.5f;
  t.AddShape(MeshShape{t.Box({0.1f, 0, -0.4f}, {0.8f, 0.7f, 0.3f})}, t.AddMaterial(glass));
  return t;
}

struct ChangedScene {
  std::string name;
  TestScene scene;
  std::vector<TechniqueSet> techniques;
};

std::vector<size_t> BlockOf(int32_t index) {
  std::vector<size_t> pixels;
  const int32_t across = kPixels / kBlock;
  for (int32_t y = 0; y < kBlock; ++y) {
    for (int32_t x = 0; x < kBlock; ++x) {
      const int32_t row = index / across * kBlock + y, column = index % across * kBlock + x;
      pixels.push_back(static_cast<size_t>(row * kPixels + column));
    }
  }
  return pixels;
}

BothFilms RenderChanged(const SceneDescription& scene, TechniqueSet techniques) {
  FrameSettings settings = SquareSettings(kPixels, DrawCount(32, 512), 8);
  settings.techniques = techniques;
  return RenderBothFilms(*Compile(scene, settings));
}

// G19: the image of a scene does not depend on where it is, how it is turned or written.
TEST(SceneChangeStability, G19ChangedScenesKeepTheirImage) {
  const std::vector<TechniqueSet> all{TechniqueSet::kCamera, TechniqueSet::kLight,
                                      TechniqueSet::kCameraAndLight};
  const std::vector<ChangedScene> cases{
      {"diffuse", Diffuse({1}), all},
      {"glossy", Glossy({1}), {TechniqueSet::kCamera, TechniqueSet::kCameraAndLight}},
      {"closed room", LitRoom(1), all},
      {"flush room", FlushRoom(), {TechniqueSet::kCamera, TechniqueSet::kCameraAndLight}},
  };
  double largest = 0;
  for (const ChangedScene& of : cases) {
    SCOPED_TRACE(of.name);
    for (const TechniqueSet techniques : of.techniques) {
      SCOPED_TRACE(techniques.Name());
      const BothFilms plain = RenderChanged(of.scene.scene, techniques);
      for (const Change& change : ImageKeepingChanges()) {
        SCOPED_TRACE(change.name);
        SceneDescription scene = of.scene.scene;
        change.apply(&scene);
        const BothFilms changed = RenderChanged(scene, techniques);
        for (int32_t block = 0; block < 4; ++block) {
          const ComponentMean expected = MeanOverPixels(plain, 1, BlockOf(block)),
                              measured = MeanOverPixels(changed, 1, BlockOf(block));
          const double error = std::hypot(expected.standard_error, measured.standard_error);
          EXPECT_NEAR(measured.value, expected.value, 5 * error + 0.01 * expected.value);
          largest = std::max(largest, std::fabs(measured.value - expected.value) / expected.value -
                                          5 * error / expected.value);
        }
      }
    }
  }
  ExpectHardCase({.row = "G19",
                  .figure = "largest relative change of a block of the image, beyond its error",
                  .expected = 0,
                  .measured = std::max(0.0, largest),
                  .tolerance = 0.01});
}

}  // namespace
}  // namespace sheaf::render
