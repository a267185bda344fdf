// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of overlapping interiors, named as in the catalogue (V8, V9, V12, G12). The tolerance
// of means is 5 standard errors of the difference (ExpectSameMean) unless stated otherwise.
#include <algorithm>
#include <optional>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/interior_scene.h"
#include "tests/support/long_tests.h"

namespace sheaf::render {
namespace {

constexpr float kGlass = 1.5f, kWater = 1.33f;

class NestedScene : public InteriorScene {
 public:
  using InteriorScene::InteriorScene;

  int32_t Clear(float eta, std::optional<int32_t> priority, float alpha = 0) {
    DielectricMaterial glass;
    glass.roughness = {{alpha, kNone}, {alpha, kNone}, false};
    glass.eta.mean = eta;
    const int32_t material = AddMaterial(glass);
    scene.materials.back().priority = priority;
    return material;
  }
  int32_t Absorber(Rgb sigma_a, Rgb sigma_s = {}) {
    MediumDescription medium;
    medium.name = std::to_string(scene.media.size());
    medium.sigma_a.rgb = sigma_a;
    medium.sigma_s.rgb = sigma_s;
    scene.media.push_back(medium);
    return static_cast<int32_t>(scene.media.size() - 1);
  }
  ShapeDescription& Fill(Vec3f lower, Vec3f upper, int32_t material, int32_t inside = kNone) {
    ShapeDescription& shape = AddShape(MeshShape{Box(lower, upper)}, material);
    shape.media.inside = inside;
    return shape;
  }
  // A bright sky, a floor and a light as a background.
  void LightUp() {
    ConstantEnvironment({0.3f, 0.5f, 0.9f});
    AddShape(MeshShape{Quad({-9, -2, -9}, {-9, -2, 9}, {9, -2, 9}, {9, -2, -9})},
             Diffuse({0.7f, 0.5f, 0.2f}));
    AddShape(MeshShape{Quad({-1, 4, -1}, {1, 4, -1}, {1, 4, 1}, {-1, 4, 1})}, Diffuse({}))
        .area_light = AreaLight(Rgb::Gray(6));
  }
};

const Vec3d kEye{0.7, 0.9, -5}, kCenter{0, 0, 0};

void ExpectSound(const Rendered& rendered) {
  EXPECT_EQ(rendered.mean.non_finite, 0u);
  EXPECT_EQ(rendered.stats.broken_nestings, 0u);
}

// Water in glass, modeled by hand as interfaces of relative indices, and as overlapping bodies.
TEST(NestedStability, WaterInGlassMatchesItsInterfaces) {
  for (const float alpha : {0.0f, 0.2f}) {
    SCOPED_TRACE(alpha);
    const FrameSettings settings = SquareSettings(24, DrawCount(128, 4096), 12);
    NestedScene by_hand(kEye, kCenter, 35);
    by_hand.LightUp();
    by_hand.Fill({-1, -1, -1}, {1, 1, 1}, by_hand.Clear(kGlass, {}, alpha));
    // The interface hit from the water belongs to the glass: the index inside over that outside.
    by_hand.Fill({-0.6f, -0.6f, -0.6f}, {0.6f, 0.6f, 0.6f},
                 by_hand.Clear(kWater / kGlass, {}, alpha));
    NestedScene nested(kEye, kCenter, 35);
    nested.LightUp();
    // Water displaces glass.
    nested.Fill({-1, -1, -1}, {1, 1, 1}, nested.Clear(kGlass, 1, alpha));
    nested.Fill({-0.6f, -0.6f, -0.6f}, {0.6f, 0.6f, 0.6f}, nested.Clear(kWater, 2, alpha));
    const Rendered a = RenderCounted(by_hand.scene, settings);
    const Rendered b = RenderCounted(nested.scene, settings);
    ExpectSound(b);
    ExpectSameMean(a.mean, b.mean);
  }
}

// The same with a wall: glass with a hole in it, and water larger than the hole that ends within
// the wall. Glass displaces water, so the hole's own faces are visible.
TEST(NestedStability, OverlapsResolveByPriority) {
  const FrameSettings settings = SquareSettings(24, DrawCount(128, 4096), 16);
  const auto block = [&](bool by_hand) {
    NestedScene t(kEye, kCenter, 35);
    t.LightUp();
    const int32_t glass = t.Clear(kGlass, by_hand ? std::optional<int32_t>() : 2);
    t.Fill({-1, -1, -1}, {1, 1, 1}, glass);
    const Vec3f lower{-0.6f, -0.6f, -0.6f}, upper{0.6f, 0.6f, 0.6f};
    if (by_hand) {
      t.Fill(lower, upper, t.Clear(kWater / kGlass, {}));
    } else {
      // The hole's faces belong to the glass too, and face into the hole.
      t.Fill(lower, upper, glass).reverse_orientation = true;
      t.Fill({-0.8f, -0.8f, -0.8f}, {0.8f, 0.8f, 0.8f}, t.Clear(kWater, 1));
    }
    return RenderCounted(t.scene, settings);
  };
  const Rendered nested = block(false);
  ExpectSound(nested);
  ExpectSameMean(block(true).mean, nested.mean);
}

// V8: overlapping bodies of the same interior and priority form their union: a cross of two bars is
// a cross in one piece, and a cube inside a cube is invisible.
TEST(NestedStability, V8EqualInteriorsMerge) {
  const FrameSettings settings = SquareSettings(24, DrawCount(128, 4096), 16);
  const auto cube = [&](bool twice, bool swapped) {
    NestedScene t(kEye, kCenter, 35);
    t.LightUp();
    const int32_t first = t.Clear(kGlass, 3), second = t.Clear(kGlass, 3);
    if (twice && swapped) t.Fill({-0.5f, -0.7f, -0.3f}, {0.3f, 0.5f, 0.6f}, second);
    t.Fill({-1, -1, -1}, {1, 1, 1}, first);
    if (twice && !swapped) t.Fill({-0.5f, -0.7f, -0.3f}, {0.3f, 0.5f, 0.6f}, second);
    return RenderCounted(t.scene, settings);
  };
  const Rendered one = cube(false, false), two = cube(true, false), swapped = cube(true, true);
  ExpectSound(two);
  ExpectSameMean(one.mean, two.mean);
  EXPECT_TRUE(two.film == swapped.film);
}

// Two overlapping balls of the same priority, with equal interiors and with one denser: their order
// in the file changes no bit.
TEST(NestedStability, V8OrderDoesNotMatter) {
  for (const float other : {kGlass, kWater}) {
    const auto balls = [&](bool swapped) {
      NestedScene t(kEye, kCenter, 35);
      t.LightUp();
      const auto add = [&t](float eta, double x) {
        t.AddShape(SphereShape{1, -1, 1, 360}, t.Clear(eta, 1), TranslateMatrix({x, 0, 0}));
      };
      if (swapped) add(other, 0.6);
      add(kGlass, -0.6);
      if (!swapped) add(other, 0.6);
      return RenderCounted(t.scene, SquareSettings(24, 64, 12));
    };
    const Rendered a = balls(false), b = balls(true);
    ExpectSound(a);
    EXPECT_TRUE(a.film == b.film);
    EXPECT_GT(a.mean.mean.g, 0.05f);
  }
}

// Bodies of index 1 are invisible, and do not block light from behind.
TEST(NestedStability, MatchedIndexIsInvisible) {
  const auto room = [](bool with_bodies) {
    NestedScene t(kEye, kCenter, 35);
    t.LightUp();
    t.AddShape(SphereShape{0.5f, -0.5f, 0.5f, 360}, t.Diffuse({0.2f, 0.8f, 0.3f}));
    if (with_bodies) {
      t.Fill({-1, -1, -1}, {1, 1, 1}, t.Clear(1, 1));
      t.Fill({-0.8f, -1.5f, -0.8f}, {0.8f, 0.8f, 0.8f}, t.Clear(1, 2));
    }
    return RenderCounted(t.scene, SquareSettings(24, DrawCount(64, 2048), 6));
  };
  const Rendered bodies = room(true);
  ExpectSound(bodies);
  ExpectSameMean(room(false).mean, bodies.mean);
}

// V12: clear bodies of any indices are invisible under a constant sky, however they overlap.
TEST(NestedStability, V12Furnace) {
  for (const float alpha : {0.0f, 0.3f}) {
    NestedScene t(kEye, kCenter, 40);
    t.ConstantEnvironment(Rgb::Gray(1));
    t.Fill({-1, -1, -1}, {1, 1, 1}, t.Clear(kGlass, 1, alpha));
    t.Fill({-1.3f, -0.4f, -0.5f}, {1.2f, 0.5f, 0.4f}, t.Clear(kWater, 2, alpha));
    t.AddShape(SphereShape{0.7f, -0.7f, 0.7f, 360}, t.Clear(1, 7, alpha));
    t.AddShape(SphereShape{0.6f, -0.6f, 0.6f, 360}, t.Clear(2.4f, 3, alpha),
               TranslateMatrix({0.5, 0.5, -0.8}));
    const Rendered rendered = RenderCounted(t.scene, SquareSettings(24, DrawCount(64, 2048), 4000));
    ExpectSound(rendered);
    EXPECT_NEAR(rendered.mean.mean.g, 1,
                5 * rendered.mean.standard_error.g + (alpha > 0 ? 1e-2 : 1e-3));
  }
}

// V9: a camera inside glass inside water has the correct interior, however the bodies are nested.
TEST(NestedStability, V9CameraInsideGlass) {
  const auto seen = [](bool by_hand) {
    NestedScene t({0.05, 0.02, 0.01}, {1, 0.5, 3}, 60);
    t.LightUp();
    if (by_hand) {
      // Inside a box only the ratio of the outer to the inner index matters.
      t.Fill({-1, -1, -1}, {1, 1, 1}, t.Clear(kGlass / kWater, {}));
      t.Fill({-1.5f, -1.5f, -1.5f}, {1.5f, 1.5f, 1.5f}, t.Clear(kWater, {}));
    } else {
      t.Fill({-1, -1, -1}, {1, 1, 1}, t.Clear(kGlass, 5));
      t.Fill({-1.5f, -1.5f, -1.5f}, {1.5f, 1.5f, 1.5f}, t.Clear(kWater, 0));
      t.Fill({-0.5f, -0.5f, -0.5f}, {0.5f, 0.5f, 0.5f}, t.Clear(kWater, 4));
    }
    return RenderCounted(t.scene, SquareSettings(24, DrawCount(128, 4096), 16));
  };
  const Rendered nested = seen(false);
  ExpectSound(nested);
  ExpectSameMean(seen(true).mean, nested.mean);
}

// A medium fills the volume where its body has priority: blue water around a glass bar that
// displaces it absorbs only outside the bar. In closed form, with index 1 throughout.
TEST(NestedStability, MediaObeyPriorities) {
  for (const bool bar_is_higher : {false, true}) {
    NestedScene t({0, 0, -4}, {0, 0, 0}, 0.01f);
    t.ConstantEnvironment(Rgb::Gray(1));
    t.Fill({-9, -9, -1}, {9, 9, 1}, t.Clear(1, 2), t.Absorber({1, 0.5f, 0.1f}));
    t.Fill({-8, -8, -0.25f}, {8, 8, 0.25f}, t.Clear(1, bar_is_higher ? 3 : 1),
           t.Absorber({0.2f, 0.4f, 0.8f}));
    const Rendered rendered = RenderCounted(t.scene, SquareSettings(2, 16, 5));
    ExpectSound(rendered);
    const double ways[2] = {bar_is_higher ? 1.5 : 2, bar_is_higher ? 0.5 : 0};
    const Rgb water{1, 0.5f, 0.1f}, bar{0.2f, 0.4f, 0.8f};
    for (size_t c = 0; c < 3; ++c) {
      EXPECT_NEAR(rendered.mean.mean[c],
                  std::exp(-ways[0] * static_cast<double>(water[c]) -
                           ways[1] * static_cast<double>(bar[c])),
                  1e-5);
    }
  }
}

// Skin with glass in it: a body that displaces another also displaces its scattering.
TEST(NestedStability, SubsurfaceObeysPriorities) {
  const FrameSettings settings = SquareSettings(16, DrawCount(128, 2048), 64);
  const auto ball = [&](bool covered) {
    NestedScene t(kEye, kCenter, 35);
    t.LightUp();
    const int32_t skin = t.SubsurfaceOf(Rgb::Gray(0.2f), Rgb::Gray(3), 0, 1.4f);
    t.scene.materials.back().priority = 1;
    if (covered) t.AddSubsurface(SphereShape{0.5f, -0.5f, 0.5f, 360}, skin);
    t.AddShape(SphereShape{0.8f, -0.8f, 0.8f, 360}, t.Clear(kGlass, 2));
    return RenderCounted(t.scene, settings);
  };
  const Rendered covered = ball(true);
  ExpectSound(covered);
  ExpectSameMean(ball(false).mean, covered.mean);
}

// G12: a ray can leave an open body without having entered it: such paths end, and are counted.
TEST(NestedStability, G12BrokenNestingIsCounted) {
  NestedScene t({0, 0, -4}, {0, 0, 0}, 0.01f);
  t.ConstantEnvironment(Rgb::Gray(1));
  t.AddShape(MeshShape{t.Quad({-1, -1, 0}, {-1, 1, 0}, {1, 1, 0}, {1, -1, 0})}, t.Clear(1.01f, 1));
  const Rendered rendered = RenderCounted(t.scene, SquareSettings(4, 16, 5));
  EXPECT_GT(rendered.stats.broken_nestings, 240u);
  EXPECT_LT(rendered.mean.mean.g, 0.05f);
}

}  // namespace
}  // namespace sheaf::render
