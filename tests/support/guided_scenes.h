// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Scenes for tests of path guiding, and a training that is small enough for them.
#pragma once

#include "tests/support/interior_scene.h"
#include "tests/support/technique_scenes.h"

namespace sheaf::render {

// 19,456 paths in all.
inline constexpr CompileTechniques kSmallTraining{.training_paths_first = 1024};

// A closed room without a lamp, seen from within. Its wall at z = 2 has a slit of the given width
// from floor to ceiling, behind which a lamp lights a chamber.
inline TestScene SlitRoom(Tint tint, float width) {
  TestScene t({-0.2, 1.1, -2.9}, {0.1, 1, 0}, 55);
  t.AddShape(MeshShape{t.Box({-2, 0, -3}, {2, 2.5f, 4})}, t.Diffuse(tint({0.7f, 0.65f, 0.55f})));
  const int32_t wall = t.Diffuse(tint({0.5f, 0.6f, 0.65f}));
  constexpr float kSlitX = 0.9f, kWallZ = 2;
  const auto add_wall = [&](float from, float to) {
    t.AddShape(MeshShape{t.Quad({from, 0, kWallZ}, {from, 2.5f, kWallZ}, {to, 2.5f, kWallZ},
                                {to, 0, kWallZ})},
               wall);
  };
  add_wall(-2, kSlitX);
  add_wall(kSlitX + width, 2);
  t.AddShape(MeshShape{t.Quad({-1.7f, 2.4f, 2.6f}, {-0.3f, 2.4f, 2.6f}, {-0.3f, 2.4f, 3.4f},
                              {-1.7f, 2.4f, 3.4f})},
             t.Diffuse({}))
      .area_light = t.AreaLight(tint({60, 50, 40}));
  t.AddShape(kBall, t.Diffuse(tint({0.4f, 0.6f, 0.3f})), TranslateMatrix({-0.6, 0.6, 0.6}));
  return t;
}

// A hall of many small lamps, half of which are behind its middle wall.
inline TestScene DividedHall(Tint tint) {
  TestScene t({0, 1.2, -4.4}, {-0.6, 0.9, 0}, 60);
  t.AddShape(MeshShape{t.Box({-6, 0, -5}, {6, 3, 5})}, t.Diffuse(tint({0.6f, 0.6f, 0.5f})));
  t.AddShape(MeshShape{t.Box({0.4f, 0, -3}, {0.5f, 3, 5})}, t.Diffuse(tint({0.5f, 0.4f, 0.4f})));
  const int32_t black = t.Diffuse({});
  for (int i = 0; i < 80; ++i) {
    const double x = -5.6 + 1.12 * (i % 10) + (i % 10 < 5 ? 0.1 : 0.5), z = -4.5 + 1.2 * (i / 10);
    const int32_t light = t.AreaLight(tint({3, 2.5f, 2}));
    t.AddShape(SphereShape{0.04f, -0.04f, 0.04f, 360}, black, TranslateMatrix({x, 2.8, z}))
        .area_light = light;
  }
  return t;
}

// Five times five closed rooms with four lamps each, in the middle one of which the camera stands:
// most lamps are behind walls, and those of the next rooms are hardly farther than its own.
inline TestScene ClosedRooms(Tint tint) {
  TestScene t({-0.8f, 1.5f, -0.8f}, {0.5f, 0.7f, 0.5f}, 60);
  t.AddShape(MeshShape{t.Box({-5, 0, -5}, {5, 3, 5})}, t.Diffuse(tint({0.6f, 0.6f, 0.5f})));
  const int32_t gray = t.Diffuse(tint({0.5f, 0.4f, 0.4f})), black = t.Diffuse({});
  for (const float at : {-3.0f, -1.0f, 1.0f, 3.0f}) {
    t.AddShape(MeshShape{t.Box({at - 0.02f, 0, -5}, {at + 0.02f, 3, 5})}, gray);
    t.AddShape(MeshShape{t.Box({-5, 0, at - 0.02f}, {5, 3, at + 0.02f})}, gray);
  }
  for (int i = 0; i < 100; ++i) {
    const double x = -4.5 + i % 10, z = -4.5 + i / 10;
    const int32_t light = t.AreaLight(tint({30, 25, 20}));
    t.AddShape(SphereShape{0.04f, -0.04f, 0.04f, 360}, black, TranslateMatrix({x, 2.8, z}))
        .area_light = light;
  }
  return t;
}

// A ball of wax, and rough glass half in a body of colored water.
inline TestScene Bodies(Tint tint) {
  InteriorScene t(OpenBox(tint));
  AddPointEmitter(&t, tint, 1);
  t.AddSubsurface(kBall,
                  t.SubsurfaceOf(tint({0.1f, 0.3f, 0.6f}), tint({8, 7, 6}), 0.3f, 1.3f, 0.5f),
                  TranslateMatrix({-1.25, 0.6, 0.3}));
  const auto add_glass = [&](float eta, int32_t priority) {
    DielectricMaterial glass;
    glass.roughness = {{0.8f, kNone}, {0.8f, kNone}, true};
    glass.eta.mean = eta;
    const int32_t material = t.AddMaterial(glass);
    t.scene.materials.back().priority = priority;
    return material;
  };
  t.AddShape(kBall, add_glass(1.5f, 2), TranslateMatrix({0, 0.7, 0.5}));
  MediumDescription ink;
  ink.name = "ink";
  ink.sigma_a.rgb = tint({0.8f, 0.4f, 0.1f});
  ink.sigma_s.rgb = tint({0.2f, 0.4f, 0.6f});
  t.AddShape(MeshShape{t.Box({-0.5f, 0.01f, -0.1f}, {0.5f, 0.6f, 1.1f})}, add_glass(1.33f, 1))
      .media.inside = static_cast<int32_t>(t.scene.media.size());
  t.scene.media.push_back(ink);
  return t;
}

}  // namespace sheaf::render
