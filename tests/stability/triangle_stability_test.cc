// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of meeting triangles, by the names of the catalogue: G3 (no ray leaves a closed mesh).
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "common/math/transform.h"
#include "gtest/gtest.h"
#include "tests/support/test_scene.h"
#include "worker/render/embree_scene.h"
#include "worker/render/leak_guard.h"
#include "worker/render/scene_geometry.h"

namespace sheaf::render {
namespace {

constexpr double kPi = std::numbers::pi;

bool LongTests() { return std::getenv("SHEAF_LONG_TESTS") != nullptr; }

struct TracedScene {
  SceneGeometry geometry;
  std::unique_ptr<EmbreeScene> tracer;
};
std::unique_ptr<TracedScene> Traced(SceneDescription scene) {
  absl::StatusOr<BakedScene> baked = BakeScene(&scene);
  EXPECT_TRUE(baked.ok()) << baked.status();
  auto traced = std::make_unique<TracedScene>();
  traced->geometry = std::move(baked->geometry);
  absl::StatusOr<std::unique_ptr<EmbreeScene>> tracer = EmbreeScene::Build(traced->geometry, 1);
  EXPECT_TRUE(tracer.ok()) << tracer.status();
  traced->tracer = *std::move(tracer);
  return traced;
}

struct Triangles {
  std::vector<Vec3f> positions;
  std::vector<uint32_t> indices;
};
// A closed sphere of triangles about `center`, front outside.
Triangles Globe(Vec3d center, int rings, int sectors) {
  Triangles globe;
  const auto vertex = [&](int ring, int sector) -> uint32_t {
    if (ring == 0) return 0;
    if (ring == rings) return 1;
    return static_cast<uint32_t>(2 + (ring - 1) * sectors + sector % sectors);
  };
  globe.positions = {ToFloat(center + Vec3d{0, 0, 1}), ToFloat(center + Vec3d{0, 0, -1})};
  for (int r = 1; r < rings; ++r) {
    for (int s = 0; s < sectors; ++s) {
      const double theta = kPi * r / rings, phi = 2 * kPi * s / sectors;
      globe.positions.push_back(
          ToFloat(center + Vec3d{std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi),
                                 std::cos(theta)}));
    }
  }
  for (int r = 0; r < rings; ++r) {
    for (int s = 0; s < sectors; ++s) {
      const uint32_t a = vertex(r, s), b = vertex(r + 1, s), c = vertex(r + 1, s + 1),
                     d = vertex(r, s + 1);
      if (r + 1 < rings) globe.indices.insert(globe.indices.end(), {a, b, c});
      if (r > 0) globe.indices.insert(globe.indices.end(), {a, c, d});
    }
  }
  return globe;
}

// Where on a random triangle of the globe a ray is aimed.
enum class Aim { kAnywhere, kVertex, kEdgeMiddle };
Vec3f TargetOn(const Triangles& globe, Aim aim, Random* random) {
  const size_t triangle =
      static_cast<size_t>(random->Uniform() * static_cast<double>(globe.indices.size() / 3));
  const uint32_t* t = &globe.indices[3 * triangle];
  const Vec3f a = globe.positions[t[0]], b = globe.positions[t[1]], c = globe.positions[t[2]];
  if (aim == Aim::kVertex) return a;
  if (aim == Aim::kEdgeMiddle) return (a + b) * 0.5f;
  const auto u = static_cast<float>(random->Uniform()), v = static_cast<float>(random->Uniform());
  return a * (1 - std::fmax(u, v)) + b * std::fabs(u - v) + c * std::fmin(u, v);
}

// Over this, a ray from the globe of radius 1 does not go along the triangle it leaves.
constexpr float kShortestRay = 0.1f;

// Rays from inside the globe that meet nothing, or nothing in the way.
struct Escapes {
  uint64_t rays = 0, shadow_rays = 0;
};
template <typename MakeRay>
Escapes CountEscapes(const TracedScene& scene, const Triangles& globe, Aim aim, MakeRay make_ray) {
  const int ray_count = LongTests() ? 10000000 : 150000;
  Random random(4);
  Escapes escapes;
  for (int i = 0; i < ray_count; ++i) {
    Ray ray = make_ray(&random);
    do {
      ray.d = TargetOn(globe, aim, &random) - ray.o;
    } while (Length(ray.d) < kShortestRay);
    RawHit hit;
    escapes.rays += !scene.tracer->Intersect(ray, &hit);
    escapes.shadow_rays += !scene.tracer->Occluded(ray);
  }
  return escapes;
}

constexpr int kRings = 200, kSectors = 400;

// G3: rays inside a closed mesh about the camera, aimed where triangles meet. Without the guard
// 2 % of those aimed at vertices escape.
TEST(TriangleStability, G3NoRayLeavesAClosedRoom) {
  const Triangles globe = Globe({0, 0, 0}, kRings, kSectors);
  TestScene t({0, 0, 0}, {0, 0, 1}, 60);
  t.AddShape(MeshShape{t.AddMesh(globe.positions, globe.indices)}, kNone);
  const std::unique_ptr<TracedScene> scene = Traced(t.scene);
  for (const Aim aim : {Aim::kAnywhere, Aim::kVertex, Aim::kEdgeMiddle}) {
    const Escapes escapes = CountEscapes(*scene, globe, aim, [](Random* random) {
      Ray ray;
      ray.o = random->Direction() * 0.3f;
      return ray;
    });
    EXPECT_EQ(escapes.rays, 0u) << static_cast<int>(aim);
    EXPECT_EQ(escapes.shadow_rays, 0u) << static_cast<int>(aim);
  }
}

// G3: rays that leave a triangle to the inside of its closed mesh, wherever the camera is: what
// goes through glass. Front outside and front inside.
TEST(TriangleStability, G3NoRayLeavesAClosedMeshFromItsInside) {
  for (const bool front_inside : {false, true}) {
    Triangles globe = Globe({0, 0, 0}, kRings, kSectors);
    if (front_inside) {
      for (size_t i = 0; i < globe.indices.size(); i += 3) {
        std::swap(globe.indices[i], globe.indices[i + 1]);
      }
    }
    TestScene t({0, 0, -5}, {0, 0, 0}, 60);
    t.AddShape(MeshShape{t.AddMesh(globe.positions, globe.indices)}, kNone);
    const std::unique_ptr<TracedScene> scene = Traced(t.scene);
    // Render space begins at the camera; the world's meshes are baked there.
    globe.positions = scene->geometry.groups[0].meshes[0].positions;
    globe.indices = scene->geometry.groups[0].meshes[0].indices;
    for (const Aim aim : {Aim::kVertex, Aim::kEdgeMiddle}) {
      const Escapes escapes = CountEscapes(*scene, globe, aim, [&](Random* random) {
        const auto triangle = static_cast<uint32_t>(random->Uniform() *
                                                    static_cast<double>(globe.indices.size() / 3));
        const uint32_t* k = &globe.indices[3 * size_t{triangle}];
        const Vec3f on = globe.positions[k[0]] * 0.3f + globe.positions[k[1]] * 0.3f +
                         globe.positions[k[2]] * 0.4f;
        Ray ray;
        ray.o = on + (Vec3f{0, 0, 5} - on) * 1e-3f;
        ray.source = {0, triangle, kNotPlaced};
        return ray;
      });
      EXPECT_EQ(escapes.rays, 0u) << static_cast<int>(aim);
      EXPECT_EQ(escapes.shadow_rays, 0u) << static_cast<int>(aim);
    }
  }
}

TEST(TriangleStability, G3ClosedMeshesAreKnownByTheirEdges) {
  const auto side = [](const Triangles& t) { return EnclosedSideOf(t.positions, t.indices); };
  Triangles globe = Globe({3, -2, 7}, 8, 12);
  EXPECT_EQ(side(globe), EnclosedSide::kBack);
  // Seams: a corner of its own for each triangle.
  Triangles torn;
  for (const uint32_t index : globe.indices) {
    torn.indices.push_back(static_cast<uint32_t>(torn.positions.size()));
    torn.positions.push_back(globe.positions[index]);
  }
  EXPECT_EQ(side(torn), EnclosedSide::kBack);
  for (size_t i = 0; i < torn.indices.size(); i += 3)
    std::swap(torn.indices[i], torn.indices[i + 1]);
  EXPECT_EQ(side(torn), EnclosedSide::kFront);
  // One triangle less, or one turned over, leaves a border.
  Triangles open = globe;
  open.indices.resize(open.indices.size() - 3);
  EXPECT_EQ(side(open), EnclosedSide::kNone);
  std::swap(globe.indices[0], globe.indices[1]);
  EXPECT_EQ(side(globe), EnclosedSide::kNone);
  EXPECT_EQ(side({}), EnclosedSide::kNone);
}

}  // namespace
}  // namespace sheaf::render
