// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FogScene: small scenes with participating media.
#pragma once

#include <cstdint>
#include <string>

#include "tests/support/test_scene.h"

namespace sheaf::render {

// A scene with media; its shapes are interfaces or walls.
class FogScene : public TestScene {
 public:
  using TestScene::TestScene;

  int32_t AddMedium(Rgb sigma_a, Rgb sigma_s, float g = 0, Rgb radiance = {}) {
    MediumDescription medium;
    medium.name = std::to_string(scene.media.size());
    medium.sigma_a.rgb = sigma_a;
    medium.sigma_s.rgb = sigma_s;
    medium.g = g;
    medium.emits = !radiance.IsBlack();
    medium.radiance.rgb = radiance;
    scene.media.push_back(medium);
    return static_cast<int32_t>(scene.media.size() - 1);
  }
  template <typename Shape>
  ShapeDescription& Fill(Shape shape, int32_t inside, int32_t outside = kNone) {
    ShapeDescription& added = AddShape(shape, AddMaterial(InterfaceMaterial{}));
    added.media = {inside, outside};
    return added;
  }
  void FillBox(Vec3f lower, Vec3f upper, int32_t inside, int32_t outside = kNone) {
    Fill(MeshShape{Box(lower, upper)}, inside, outside);
  }
};

}  // namespace sheaf::render
