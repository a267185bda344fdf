// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Scenes that emissive media light, for tests of techniques that must have the same expectation.
#pragma once

#include <utility>

#include "tests/support/technique_scenes.h"

namespace sheaf::render {

// A medium of its own in a shape. material: of its boundary.
template <typename Shape>
void AddMedium(TestScene* t, MediumDescription medium, Shape shape, int32_t material,
               Matrix4 place = {}) {
  t->AddShape(shape, material, place).media.inside = static_cast<int32_t>(t->scene.media.size());
  t->scene.media.push_back(std::move(medium));
}

inline MediumDescription EmissiveGas(Rgb sigma_a, Rgb sigma_s, Rgb radiance) {
  MediumDescription medium;
  medium.sigma_a.rgb = sigma_a;
  medium.sigma_s.rgb = sigma_s;
  medium.emits = true;
  medium.radiance.rgb = radiance;
  return medium;
}

// A grid in the unit cube, whose emission varies otherwise than its density.
inline MediumDescription EmissiveGrid(Rgb sigma_a, Rgb sigma_s, Rgb radiance, Matrix4 place) {
  MediumDescription medium = EmissiveGas(sigma_a, sigma_s, radiance);
  UniformGridMedium grid;
  grid.box = {{4, 4, 4}, {0, 0, 0}, {1, 1, 1}};
  for (int i = 0; i < 64; ++i) {
    grid.density.push_back(i % 3 == 0 ? 0.0f : 0.25f * static_cast<float>(i % 7));
    grid.radiance_scale.push_back(static_cast<float>(i % 5));
  }
  medium.kind = std::move(grid);
  medium.world_from_medium = place;
  return medium;
}

// Two balls of gas, one of them scatters, and a flame that moves while the shutter is open and does
// not scatter; nothing else emits.
inline TestScene Lamps(Tint tint) {
  TestScene t = OpenBox(tint);
  const int32_t interface = t.AddMaterial(InterfaceMaterial{});
  AddMedium(&t, EmissiveGas(tint({0.5f, 0.8f, 1.2f}), {}, tint({4, 3, 2})), kBall, interface,
            TranslateMatrix({-1.1, 0.9, 0}));
  AddMedium(&t, EmissiveGas(tint({2, 1, 0.5f}), tint({1, 2, 1}), tint({1, 2, 3})), kBall, interface,
            TranslateMatrix({1.1, 0.9, 0.3}));
  const Matrix4 place = TranslateMatrix({-0.4, 0.2, -1.2}) * ScaleMatrix({0.8, 1.1, 0.8});
  AddMedium(&t, EmissiveGrid(tint({1, 0.6f, 0.8f}), {}, tint({0.9f, 0.7f, 0.3f}), place),
            MeshShape{t.Box({0, 0, 0}, {1, 1, 1})}, interface, place);
  auto& grid = std::get<UniformGridMedium>(t.scene.media.back().kind);
  grid.velocity.assign(grid.box.size(), {0.2f, 0, 0.1f});
  t.scene.camera.shutter_close = 1;
  return t;
}

// The same behind smooth glass, which no light sample passes: a ball of glass that is full of gas,
// and a flame in a hollow one.
inline TestScene Lanterns(Tint tint) {
  TestScene t = OpenBox(tint);
  const int32_t glass = t.AddMaterial(DielectricMaterial{});
  const int32_t interface = t.AddMaterial(InterfaceMaterial{});
  constexpr SphereShape kLarge{0.7f, -0.7f, 0.7f, 360};
  AddMedium(&t, EmissiveGas(tint({0.5f, 0.8f, 1.2f}), {}, tint({4, 3, 2})), kLarge, glass,
            TranslateMatrix({-0.9, 0.75, 0.2}));
  t.AddShape(kLarge, glass, TranslateMatrix({0.9, 0.75, 0.2}));
  ShapeDescription& hollow =
      t.AddShape(SphereShape{0.65f, -0.65f, 0.65f, 360}, glass, TranslateMatrix({0.9, 0.75, 0.2}));
  hollow.reverse_orientation = true;
  const Matrix4 place = TranslateMatrix({0.55, 0.4, -0.15}) * ScaleMatrix({0.7, 0.7, 0.7});
  AddMedium(&t, EmissiveGrid(tint({1, 0.6f, 0.8f}), {}, tint({2, 1.5f, 0.5f}), place),
            MeshShape{t.Box({0, 0, 0}, {1, 1, 1})}, interface, place);
  return t;
}

// A closed room with a ball of gas; no medium scatters.
inline TestScene SmokelessRoom() {
  TestScene t = LitRoom(1);
  AddMedium(&t, EmissiveGas({3, 2, 1}, {}, {6, 5, 4}), SphereShape{0.2f, -0.2f, 0.2f, 360},
            t.AddMaterial(InterfaceMaterial{}), TranslateMatrix({-0.5, -0.1, 0.4}));
  return t;
}
// The same with a flame instead of the lamp.
inline TestScene RoomWithFlame() {
  TestScene t = SmokelessRoom();
  for (ShapeDescription& shape : t.scene.shapes) shape.area_light = kNone;
  const Matrix4 place = TranslateMatrix({-0.2, -0.9, 0.1}) * ScaleMatrix({0.3, 0.6, 0.3});
  AddMedium(&t, EmissiveGrid({2, 2, 3}, {}, {5, 3, 1}, place),
            MeshShape{t.Box({0, 0, 0}, {1, 1, 1})}, t.AddMaterial(InterfaceMaterial{}), place);
  return t;
}

}  // namespace sheaf::render
