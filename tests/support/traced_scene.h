// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TracedScene: a scene baked and ready to be traced, without materials or lights.
#pragma once

#include <memory>
#include <utility>

#include "gtest/gtest.h"
#include "worker/render/embree_scene.h"
#include "worker/render/scene_geometry.h"

namespace sheaf::render {

struct TracedScene {
  SceneGeometry geometry;
  std::unique_ptr<EmbreeScene> tracer;
};

inline std::unique_ptr<TracedScene> Traced(SceneDescription scene) {
  absl::StatusOr<BakedScene> baked = BakeScene(&scene);
  EXPECT_TRUE(baked.ok()) << baked.status();
  auto traced = std::make_unique<TracedScene>();
  traced->geometry = std::move(baked->geometry);
  absl::StatusOr<std::unique_ptr<EmbreeScene>> tracer = EmbreeScene::Build(traced->geometry, 1);
  EXPECT_TRUE(tracer.ok()) << tracer.status();
  traced->tracer = *std::move(tracer);
  return traced;
}

}  // namespace sheaf::render
