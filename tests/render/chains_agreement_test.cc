// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests that chains through smooth interfaces find the same light as paths from both ends, which
// find that of larger lamps without them.
#include <gtest/gtest.h>

#include <cstdio>
#include <string>
#include <vector>

#include "tests/support/frame_estimates.h"
#include "tests/support/technique_scenes.h"
#include "tests/support/test_scene.h"

namespace sheaf::render {
namespace {

using sheaf::testing::Bias;
using sheaf::testing::EstimatesOf;
using sheaf::testing::ExpectAgreement;
using sheaf::testing::kSizePx;
using sheaf::testing::Samples;
using sheaf::testing::TilePair;

constexpr float kLargeLampRadius = 0.14f;

void AddLargeLamp(TestScene* t, Vec3d p) {
  t->AddShape(SphereShape{kLargeLampRadius, -kLargeLampRadius, kLargeLampRadius, 360},
              t->Diffuse({}), TranslateMatrix(p))
      .area_light = t->AreaLight({50, 45, 40});
}

// A floor and a wall. The casters hang above the image, so that no path sees the lamp through them
// twice: those are too few to estimate their own variance.
TestScene Stage() {
  TestScene t({0, 1, -3.2}, {0, 0, 0}, 24);
  t.AddShape(MeshShape{t.Quad({-2, 0, -2}, {-2, 0, 2}, {2, 0, 2}, {2, 0, -2})},
             t.Diffuse({0.6f, 0.5f, 0.4f}));
  t.AddShape(MeshShape{t.Quad({-2, 0, 2}, {-2, 3, 2}, {2, 3, 2}, {2, 0, 2})},
             t.Diffuse({0.3f, 0.5f, 0.7f}));
  return t;
}

// A ball of glass, and a flat mirror. (Light paths by a convex one are few in each tile.)
TestScene BallAndMirror() {
  TestScene t = Stage();
  AddLargeLamp(&t, {-0.6, 3, -0.4});
  t.AddShape(kBall, t.AddMaterial(DielectricMaterial{}), TranslateMatrix({0.4, 1.8, 0.2}));
  ConductorMaterial mirror;
  mirror.has_reflectance = true;
  mirror.reflectance.value.rgb = {0.9f, 0.8f, 0.6f};
  t.AddShape(
      MeshShape{t.Quad({-1.5f, 1.2f, -1}, {-1.5f, 2.6f, -1}, {-1.5f, 2.6f, 1}, {-1.5f, 1.2f, 1})},
      t.AddMaterial(mirror));
  return t;
}

// A ball of glass around one of another medium: four interfaces.
TestScene Shell() {
  TestScene t = Stage();
  AddLargeLamp(&t, {0.5, 3.2, 0});
  t.AddShape(kBall, t.AddMaterial(DielectricMaterial{}), TranslateMatrix({0, 1.7, 0.2}));
  DielectricMaterial inside;
  inside.eta.mean = 1.2f;
  t.AddShape(SphereShape{0.45f, -0.45f, 0.45f, 360}, t.AddMaterial(inside),
             TranslateMatrix({0, 1.7, 0.2}));
  return t;
}

// A floor below a pane, through which both the camera and the lamp look at it. The light on it is
// so smooth that merging hardly blurs it.
TestScene Window() {
  TestScene t({0, 3, -0.1}, {0, 0, 0}, 24);
  AddLargeLamp(&t, {0.9, 1.8, 0});
  t.AddShape(MeshShape{t.Quad({-2, 0, -2}, {-2, 0, 2}, {2, 0, 2}, {2, 0, -2})},
             t.Diffuse({0.6f, 0.5f, 0.4f}));
  t.AddShape(MeshShape{t.Box({-3, 1, -3}, {3, 1.1f, 3})}, t.AddMaterial(DielectricMaterial{}));
  return t;
}

// Light through a window that the camera looks through, which light paths do not find alone.
TEST(ChainsAgreementTest, ChainsFindWhatMergingFinds) {
  const TestScene window = Window();
  FrameSettings settings = SquareSettings(kSizePx, Samples(256), 5);
  settings.techniques = {Technique::kLightPaths, Technique::kMerging};
  const auto merged = EstimatesOfBoth(RenderBothFilms(*Compile(window.scene, settings)));
  settings.techniques = {Technique::kChains};
  ++settings.seed;
  RenderStats stats;
  const auto by_chains = EstimatesOf(RenderAll(*Compile(window.scene, settings), &stats));
  EXPECT_EQ(stats.capped_chains, 0u);
  std::vector<TilePair> tiles;
  for (size_t tile = 0; tile < merged.size(); ++tile) {
    tiles.push_back({merged[tile], by_chains[tile]});
  }
  ExpectAgreement("window, by merging", LongTests() ? 0.02 : 0.06, tiles);
}

void ExpectChainsAgree(const std::string& name, const TestScene& scene, ColorTransport color,
                       int32_t depth) {
  FrameSettings settings = SquareSettings(kSizePx, Samples(128), depth);
  settings.color = color;
  settings.techniques = TechniqueSet::kCameraAndLight;
  const auto by_both = EstimatesOfBoth(RenderBothFilms(*Compile(scene.scene, settings)));
  settings.techniques = {Technique::kChains};
  ++settings.seed;
  RenderStats stats;
  const auto by_chains = EstimatesOf(RenderAll(*Compile(scene.scene, settings), &stats));
  EXPECT_GT(stats.chains, 0u);
  EXPECT_EQ(stats.capped_chains, 0u);
  std::vector<TilePair> tiles;
  for (size_t tile = 0; tile < by_both.size(); ++tile) {
    tiles.push_back({by_both[tile], by_chains[tile]});
  }
  ExpectAgreement(name, 3.5 * Bias(), tiles);
}

TEST(ChainsAgreementTest, ChainsFindWhatBothKindsOfPathsFind) {
  ExpectChainsAgree("ball and mirror", BallAndMirror(), ColorTransport::kRgb, 3);
}
TEST(ChainsAgreementTest, ChainsFindWhatBothKindsOfPathsFindThroughFourInterfaces) {
  ExpectChainsAgree("shell", Shell(), ColorTransport::kRgb, 5);
}
TEST(ChainsAgreementTest, ChainsFindWhatBothKindsOfPathsFindInSpectra) {
  ExpectChainsAgree("ball and mirror, spectra", BallAndMirror(), ColorTransport::kSpectral, 3);
}

}  // namespace
}  // namespace sheaf::render
