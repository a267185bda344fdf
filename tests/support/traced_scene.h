// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TracedScene: a scene baked and ready for tracing, without materials and lights; the intersections
// of rays with it, and rays that leave from there.
#pragma once

#include <memory>
#include <utility>

#include "gtest/gtest.h"
#include "worker/render/accel/embree_scene.h"
#include "worker/render/geometry/surface_point.h"
#include "worker/render/scene/scene_baker.h"
#include "worker/render/traits/trait_set.h"

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

// The first intersection of a ray from one point towards another; returns false if there is none.
// hit: may be null.
inline bool HitTowards(const TracedScene& scene, Vec3f from, Vec3f to, SurfacePoint* point,
                       RawHit* hit = nullptr) {
  Ray ray;
  ray.o = from;
  ray.d = to - from;
  RawHit raw_hit;
  if (!scene.tracer->Intersect(ray, &raw_hit)) return false;
  *point = MakeSurfacePoint<kAllTraits>(scene.geometry, ray, raw_hit);
  if (hit != nullptr) *hit = raw_hit;
  return true;
}

// The next ray of a path, leaving the point.
inline Ray Spawned(const SurfacePoint& point, Vec3f direction) {
  Ray ray;
  Leave(point, direction, &ray);
  ray.d = direction;
  return ray;
}

}  // namespace sheaf::render
