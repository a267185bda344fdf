// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Scenes for tests of techniques that must have the same expectation. Lights are large and lobes
// wide, so that contributions rare for one technique are still frequent enough to measure.
#pragma once

#include <utility>

#include "tests/support/test_scene.h"

namespace sheaf::render {

// Weight of colors mixed with gray; 0 makes everything gray.
struct Tint {
  float saturation = 0;
  Rgb operator()(Rgb c) const {
    const float gray = (c.r + c.g + c.b) / 3;
    return Rgb::Gray(gray * (1 - saturation)) + c * saturation;
  }
};

// The image ends below the height of the lights: a light seen edge on is hit so rarely that the
// draws of a tile are far from normally distributed.
inline TestScene OpenBox(Tint tint) {
  TestScene t({0, 1, -3.2}, {0, 0.6, 0}, 36);
  t.AddShape(MeshShape{t.Quad({-2, 0, -2}, {-2, 0, 2}, {2, 0, 2}, {2, 0, -2})},
             t.Diffuse(tint({0.6f, 0.5f, 0.4f})));
  t.AddShape(MeshShape{t.Quad({-2, 0, 2}, {-2, 3, 2}, {2, 3, 2}, {2, 0, 2})},
             t.Diffuse(tint({0.3f, 0.5f, 0.7f})));
  return t;
}

inline void AddPointEmitter(TestScene* t, Tint tint, float half_width) {
  const float w = half_width;
  t->AddShape(MeshShape{t->Quad({-w, 2.5f, -w}, {w, 2.5f, -w}, {w, 2.5f, w}, {-w, 2.5f, w})},
              t->Diffuse({}))
      .area_light = t->AreaLight(tint({6, 5, 4}));
}

inline constexpr SphereShape kBall{0.6f, -0.6f, 0.6f, 360};

// A flat light, a spherical light, and diffuse surfaces.
inline TestScene Diffuse(Tint tint) {
  TestScene t = OpenBox(tint);
  AddPointEmitter(&t, tint, 0.9f);
  t.AddShape(SphereShape{0.4f, -0.4f, 0.4f, 360}, t.Diffuse({}), TranslateMatrix({-1.2, 0.6, 0.5}))
      .area_light = t.AreaLight(tint({2, 3, 4}));
  t.AddShape(kBall, t.Diffuse(tint({0.7f, 0.7f, 0.3f})), TranslateMatrix({0.5, 0.6, 0}));
  return t;
}

// Rough metal, a rough coat, rough glass. Lobes are wide, since light samples hit narrow ones too
// rarely for 16 draws to estimate their own variance.
inline TestScene Glossy(Tint tint) {
  TestScene t = OpenBox(tint);
  AddPointEmitter(&t, tint, 1);
  ConductorMaterial metal;
  metal.roughness = {{0.5f, kNone}, {0.4f, kNone}, true};
  metal.has_reflectance = true;
  metal.reflectance.value.rgb = tint({0.9f, 0.7f, 0.5f});
  CoatedDiffuseMaterial coat;
  coat.roughness = {{0.5f, kNone}, {0.5f, kNone}, true};
  coat.reflectance.value.rgb = tint({0.2f, 0.5f, 0.6f});
  DielectricMaterial glass;
  glass.roughness = {{0.8f, kNone}, {0.8f, kNone}, true};
  t.AddShape(kBall, t.AddMaterial(metal), TranslateMatrix({-1.25, 0.6, 0.3}));
  t.AddShape(kBall, t.AddMaterial(coat), TranslateMatrix({0, 0.6, 0.6}));
  t.AddShape(kBall, t.AddMaterial(glass), TranslateMatrix({1.25, 0.6, 0.3}));
  return t;
}

// A mirror for a wall, balls of smooth metal and glass.
inline TestScene Mirrors(Tint tint) {
  TestScene test({0, 1, -3.2}, {0, 0.6, 0}, 36);
  const auto wall = [&](Vec3f a, Vec3f b, Vec3f c, Vec3f d, int32_t material) {
    test.AddShape(MeshShape{test.Quad(a, b, c, d)}, material);
  };
  ConductorMaterial mirror;
  mirror.has_reflectance = true;
  mirror.reflectance.value.rgb = tint({0.9f, 0.8f, 0.7f});
  const int32_t metal = test.AddMaterial(mirror), glass = test.AddMaterial(DielectricMaterial{});
  wall({-2, 0, -2}, {-2, 0, 2}, {2, 0, 2}, {2, 0, -2}, test.Diffuse(tint({0.6f, 0.5f, 0.4f})));
  wall({-2, 0, 2}, {-2, 3, 2}, {2, 3, 2}, {2, 0, 2}, metal);
  wall({-2, 0, -4}, {-2, 3, -4}, {-2, 3, 2}, {-2, 0, 2}, test.Diffuse(tint({0.7f, 0.3f, 0.3f})));
  wall({2, 0, 2}, {2, 3, 2}, {2, 3, -4}, {2, 0, -4}, test.Diffuse(tint({0.3f, 0.7f, 0.3f})));
  wall({2, 0, -4}, {2, 3, -4}, {-2, 3, -4}, {-2, 0, -4}, test.Diffuse(tint({0.5f, 0.5f, 0.6f})));
  AddPointEmitter(&test, tint, 0.9f);
  test.AddShape(kBall, metal, TranslateMatrix({-0.7, 0.6, 0.3}));
  test.AddShape(kBall, glass, TranslateMatrix({0.7, 0.6, 0}));
  return test;
}

// A sky, a point light, leaves, a lens, a cut-out, and a moving ball.
inline TestScene Outdoor(Tint tint) {
  TestScene t = OpenBox(tint);
  t.ConstantEnvironment(tint({0.6f, 0.8f, 1}));
  PointLight light;
  light.intensity.rgb = tint({2, 2, 1});
  light.from = {1, 2, -1};
  t.scene.lights.push_back({light, {}, {}, {}});
  t.scene.camera.lens_radius = 0.05f;
  t.scene.camera.focal_distance = 3.5f;
  t.scene.camera.shutter_close = 1;
  DiffuseTransmissionMaterial leaf;
  leaf.reflectance.value.rgb = tint({0.2f, 0.4f, 0.1f});
  leaf.transmittance.value.rgb = tint({0.1f, 0.4f, 0.1f});
  t.AddShape(MeshShape{t.Quad({-1.5f, 0.4f, 0}, {-0.5f, 0.4f, 0.4f}, {-0.5f, 1.4f, 0.4f},
                              {-1.5f, 1.4f, 0})},
             t.AddMaterial(leaf));
  ShapeDescription& lace =
      t.AddShape(kBall, t.Diffuse(tint({0.7f, 0.3f, 0.3f})), TranslateMatrix({0.2, 0.6, 0.6}));
  lace.has_alpha = true;
  lace.alpha.value = 0.6f;
  ShapeDescription& moving =
      t.AddShape(kBall, t.Diffuse(tint({0.3f, 0.3f, 0.7f})), TranslateMatrix({1.1, 0.6, 0.2}));
  moving.world_from_object.end = TranslateMatrix({1.1, 1.0, 0.2});
  return t;
}

// Two overlapping volumes, each with its own color and phase function, one of them emissive; a
// light and a sky illuminate them through their interfaces.
inline TestScene Hazy(Tint tint) {
  TestScene t = OpenBox(tint);
  AddPointEmitter(&t, tint, 1);
  t.ConstantEnvironment(tint({0.3f, 0.4f, 0.5f}));
  const auto add = [&](Rgb sigma_a, Rgb sigma_s, float g, Matrix4 place) {
    MediumDescription medium;
    medium.sigma_a.rgb = tint(sigma_a);
    medium.sigma_s.rgb = tint(sigma_s);
    medium.g = g;
    t.AddShape(kBall, t.AddMaterial(InterfaceMaterial{}), place).media.inside =
        static_cast<int32_t>(t.scene.media.size());
    t.scene.media.push_back(medium);
  };
  add({0.2f, 0.1f, 0.4f}, {1, 2, 3}, 0.4f, TranslateMatrix({-0.4, 0.7, 0.2}));
  add({0.1f, 0.3f, 0}, {2, 1, 0.5f}, -0.3f, TranslateMatrix({0.4, 0.7, 0}));
  t.scene.media[1].emits = true;
  t.scene.media[1].radiance.rgb = tint({0.5f, 0.3f, 0.1f});
  return t;
}

// A scattering cloud with a grid of scale factors for its emission, above a floor, in a slightly
// emissive haze; and a second cloud that emits and absorbs but does not scatter.
inline TestScene Burning(Tint tint) {
  TestScene t = OpenBox(tint);
  t.ConstantEnvironment(tint({0.05f, 0.06f, 0.08f}));
  const auto add = [&](MediumDescription medium, Vec3f lower, Vec3f upper) {
    t.AddShape(MeshShape{t.Box(lower, upper)}, t.AddMaterial(InterfaceMaterial{})).media.inside =
        static_cast<int32_t>(t.scene.media.size());
    t.scene.media.push_back(std::move(medium));
  };
  const auto emissive = [&](Rgb sigma_a, Rgb sigma_s, Rgb radiance) {
    MediumDescription medium;
    medium.sigma_a.rgb = tint(sigma_a);
    medium.sigma_s.rgb = tint(sigma_s);
    medium.g = 0.3f;
    medium.emits = true;
    medium.radiance.rgb = tint(radiance);
    return medium;
  };
  const auto lumps = [](Vec3d lower, Vec3d upper) {
    UniformGridMedium grid;
    grid.box = {{4, 4, 4}, lower, upper};
    for (int i = 0; i < 64; ++i) {
      grid.density.push_back(i % 3 == 0 ? 0.0f : 0.25f * static_cast<float>(i % 7));
      grid.radiance_scale.push_back(static_cast<float>(i % 5));
    }
    return grid;
  };
  MediumDescription fire = emissive({1, 0.6f, 0.8f}, {0.5f, 0.8f, 1}, {0.5f, 0.4f, 0.2f});
  fire.kind = lumps({-0.9, 0.1, -0.6}, {0.3, 1.5, 0.6});
  add(std::move(fire), {-0.9f, 0.1f, -0.6f}, {0.3f, 1.5f, 0.6f});
  MediumDescription bright = emissive({0.4f, 0.5f, 0.3f}, {}, {0.2f, 0.6f, 0.9f});
  bright.kind = lumps({0.6, 0.3, -0.5}, {1.6, 1.3, 0.5});
  add(std::move(bright), {0.6f, 0.3f, -0.5f}, {1.6f, 1.3f, 0.5f});
  add(emissive({0.02f, 0.03f, 0.04f}, {0.05f, 0.05f, 0.1f}, {0.3f, 0.2f, 0.2f}),
      {-1.95f, 0.05f, -1.9f}, {1.95f, 2.5f, 1.9f});
  return t;
}

// A room full of two kinds of fog that overlap partly, with a light of each local kind: flat ones,
// a ball, a point and a spot light.
inline TestScene Foggy(Tint tint) {
  TestScene t = Diffuse(tint);
  PointLight point;
  point.intensity.rgb = tint({0.8f, 0.6f, 0.4f});
  point.from = {1, 1.4f, -0.5f};
  t.scene.lights.push_back({point, {}, {}, {}});
  SpotLight spot;
  spot.intensity.rgb = tint({3, 4, 5});
  spot.from = {-0.3f, 2, -0.6f};
  spot.to = {0.2f, 0, 0.2f};
  t.scene.lights.push_back({spot, {}, {}, {}});
  const auto add = [&](Rgb sigma_a, Rgb sigma_s, float g, Vec3f lower, Vec3f upper) {
    MediumDescription medium;
    medium.sigma_a.rgb = tint(sigma_a);
    medium.sigma_s.rgb = tint(sigma_s);
    medium.g = g;
    t.AddShape(MeshShape{t.Box(lower, upper)}, t.AddMaterial(InterfaceMaterial{})).media.inside =
        static_cast<int32_t>(t.scene.media.size());
    t.scene.media.push_back(medium);
  };
  add({0.02f, 0.05f, 0.1f}, {0.1f, 0.2f, 0.3f}, 0.5f, {-2.5f, -0.5f, -2.4f}, {2.5f, 3.5f, 2.5f});
  add({0.1f, 0, 0}, {0.8f, 0.4f, 0.2f}, -0.2f, {-1, 0.1f, -1}, {1, 1.6f, 1});
  return t;
}

// The same lights around a lumpy cloud of one color, partly overlapped by heterogeneous haze of
// another color and by a homogeneous fog; a point and a ball are inside them, the flat light is
// outside.
inline TestScene Cloudy(Tint tint) {
  TestScene t = Diffuse(tint);
  PointLight point;
  point.intensity.rgb = tint({0.8f, 0.6f, 0.4f});
  point.from = {1, 1.4f, -0.5f};
  t.scene.lights.push_back({point, {}, {}, {}});
  const auto add = [&](Rgb sigma_a, Rgb sigma_s, float g, int modulus, Vec3f lower, Vec3f upper) {
    MediumDescription medium;
    medium.sigma_a.rgb = tint(sigma_a);
    medium.sigma_s.rgb = tint(sigma_s);
    medium.g = g;
    if (modulus > 0) {
      UniformGridMedium grid;
      grid.box = {{5, 5, 5}, ToDouble(lower), ToDouble(upper)};
      for (int i = 0; i < 125; ++i) grid.density.push_back(0.3f * static_cast<float>(i % modulus));
      medium.kind = std::move(grid);
    }
    t.AddShape(MeshShape{t.Box(lower, upper)}, t.AddMaterial(InterfaceMaterial{})).media.inside =
        static_cast<int32_t>(t.scene.media.size());
    t.scene.media.push_back(std::move(medium));
  };
  add({0.02f, 0.05f, 0.1f}, {0.2f, 0.4f, 0.6f}, 0.5f, 7, {-2.5f, -0.5f, -2.4f}, {1.9f, 2.2f, 2.4f});
  add({0.1f, 0, 0}, {0.8f, 0.4f, 0.2f}, -0.2f, 4, {-1, 0.1f, -1}, {1, 1.6f, 1});
  add({0.05f, 0.02f, 0}, {0.1f, 0.2f, 0.2f}, 0, 0, {0.2f, 0.2f, -1.2f}, {1.6f, 1.9f, 1.2f});
  return t;
}

// More lights than are weighted individually: rows of small lights of unequal power, one of them a
// point light, and a dim sky.
inline TestScene ManyLights(Tint tint) {
  TestScene t = OpenBox(tint);
  t.ConstantEnvironment(tint({0.02f, 0.03f, 0.05f}));
  PointLight light;
  light.intensity.rgb = tint({0.5f, 0.3f, 0.2f});
  light.from = {-1, 1.5f, 0};
  t.scene.lights.push_back({light, {}, {}, {}});
  for (int i = 0; i < 20; ++i) {
    const float x = -1.8f + 0.9f * static_cast<float>(i % 5);
    const float z = -1.5f + 1.0f * static_cast<float>(i / 5);
    const float strength = 1.0f + static_cast<float>(i * 7 % 10);
    t.AddShape(MeshShape{t.Quad({x, 2.2f, z}, {x + 0.2f, 2.2f, z}, {x + 0.2f, 2.2f, z + 0.2f},
                                {x, 2.2f, z + 0.2f})},
               t.Diffuse({}))
        .area_light = t.AreaLight(tint({strength, strength, 0.5f * strength}));
  }
  t.AddShape(kBall, t.Diffuse(tint({0.7f, 0.7f, 0.3f})), TranslateMatrix({0.5, 0.6, 0}));
  return t;
}

// 200 small lamps of several colors over a floor, a ball of another material and one of the
// floor's.
template <typename Floor, typename Ball>
TestScene LampsOver(Tint tint, const Floor& floor, const Ball& ball) {
  TestScene t({0, 1, -3.2}, {0, 0.6, 0}, 36);
  const int32_t below = t.AddMaterial(floor);
  t.AddShape(MeshShape{t.Quad({-2, 0, -2}, {-2, 0, 2}, {2, 0, 2}, {2, 0, -2})}, below);
  t.AddShape(kBall, t.AddMaterial(ball), TranslateMatrix({-0.8, 0.6, 0.3}));
  t.AddShape(kBall, below, TranslateMatrix({0.8, 0.6, 0.6}));
  constexpr float kSide = 0.03f;
  for (int i = 0; i < 200; ++i) {
    const float x = -2.3f + 0.23f * static_cast<float>(i % 20);
    const float z = -0.5f + 0.35f * static_cast<float>(i / 20);
    const float y = 2 + 0.1f * static_cast<float>(i * 7 % 5);
    const float red = 50.0f + 20.0f * static_cast<float>(i * 7 % 10);
    const float blue = 50.0f + 20.0f * static_cast<float>(i * 3 % 7);
    t.AddShape(MeshShape{t.Quad({x, y, z}, {x + kSide, y, z}, {x + kSide, y, z + kSide},
                                {x, y, z + kSide})},
               t.Diffuse({}))
        .area_light = t.AreaLight(tint({red, 150, blue}));
  }
  return t;
}

// A floor with a rough coat, and a ball of rough metal.
inline TestScene LampsOverGloss(Tint tint, float alpha) {
  CoatedDiffuseMaterial coat;
  coat.roughness = {{alpha, kNone}, {alpha, kNone}, false};
  coat.reflectance.value.rgb = tint({0.1f, 0.12f, 0.15f});
  ConductorMaterial metal;
  metal.roughness = {{alpha, kNone}, {alpha, kNone}, false};
  metal.has_reflectance = true;
  metal.reflectance.value.rgb = tint({0.9f, 0.7f, 0.5f});
  return LampsOver(tint, coat, metal);
}

// A floor of plastic with a rough coat, and a ball of metal under one.
inline TestScene LampsOverPlastic(Tint tint, float alpha) {
  PrincipledMaterial plastic;
  plastic.base_color.value.rgb = tint({0.1f, 0.12f, 0.15f});
  plastic.specular_tint.value.rgb = tint({1, 1, 1});
  plastic.metallic.value = 0.2f;
  plastic.roughness.value = std::sqrt(alpha);
  plastic.coat.value = 0.5f;
  plastic.coat_roughness.value = 0.8f;
  CoatedConductorMaterial metal;
  metal.roughness = {{0.2f, kNone}, {0.2f, kNone}, false};
  metal.conductor.roughness = {{alpha, kNone}, {alpha, kNone}, false};
  metal.conductor.has_reflectance = true;
  metal.conductor.reflectance.value.rgb = tint({0.9f, 0.7f, 0.5f});
  return LampsOver(tint, plastic, metal);
}

}  // namespace sheaf::render
