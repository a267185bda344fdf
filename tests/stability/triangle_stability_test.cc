// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of triangle intersection, named as in the catalogue: G3 (no ray leaves a closed mesh).
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "common/math/transform.h"
#include "gtest/gtest.h"
#include "tests/support/globe.h"
#include "tests/support/hard_case.h"
#include "tests/support/long_tests.h"
#include "tests/support/naive_geometry.h"
#include "tests/support/test_scene.h"
#include "tests/support/traced_scene.h"
#include "worker/render/geometry/leak_guard.h"
#include "worker/render/geometry/needle.h"

namespace sheaf::render {
namespace {

// The target of a ray on a random triangle of the globe.
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

// A ray longer than this, from the globe of radius 1, does not run along the triangle it leaves.
constexpr float kShortestRay = 0.1f;

// Numbers of rays that hit nothing, or no occluder.
struct Escapes {
  int rays = 0, shadow_rays = 0;
};
int RayCount() { return DrawCount(100000, 10000000); }

// Counts among RayCount() rays of make_ray, aimed at shared features of triangles.
template <typename MakeRay>
Escapes CountRayEscapes(const TracedScene& scene, const Triangles& globe, Aim aim,
                        MakeRay make_ray) {
  Random random(4);
  Escapes escapes;
  for (int i = 0; i < RayCount(); ++i) {
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
template <typename MakeRay>
void ExpectNoEscape(const TracedScene& scene, const Triangles& globe, MakeRay make_ray) {
  for (const Aim aim : {Aim::kAnywhere, Aim::kVertex, Aim::kEdgeMiddle}) {
    SCOPED_TRACE(static_cast<int>(aim));
    const Escapes escapes = CountRayEscapes(scene, globe, aim, make_ray);
    EXPECT_EQ(escapes.rays, 0);
    EXPECT_EQ(escapes.shadow_rays, 0);
  }
}
Ray FromTheMiddle(Random* random) {
  Ray ray;
  ray.o = random->Direction() * 0.3f;
  return ray;
}
// A ray from a triangle of the globe to its inside.
Ray FromTheInside(const Triangles& globe, Vec3f center, uint32_t placed, Random* random) {
  const auto triangle =
      static_cast<uint32_t>(random->Uniform() * static_cast<double>(globe.indices.size() / 3));
  const uint32_t* k = &globe.indices[3 * size_t{triangle}];
  const Vec3f on =
      globe.positions[k[0]] * 0.3f + globe.positions[k[1]] * 0.3f + globe.positions[k[2]] * 0.4f;
  Ray ray;
  ray.o = on + (center - on) * 1e-3f;
  ray.source = {0, triangle, placed};
  return ray;
}

// Fraction of rays to vertices that miss all triangles there if each is tested alone.
double NaiveEscapes(const Triangles& globe) {
  std::vector<std::vector<size_t>> triangles_at(globe.positions.size());
  for (size_t i = 0; i < globe.indices.size(); ++i) {
    triangles_at[globe.indices[i]].push_back(i / 3 * 3);
  }
  Random random(4);
  constexpr int kRays = 20000;
  int escapes = 0;
  for (int i = 0; i < kRays; ++i) {
    const auto vertex =
        static_cast<size_t>(random.Uniform() * static_cast<double>(globe.positions.size()));
    const Vec3f o = FromTheMiddle(&random).o, d = globe.positions[vertex] - o;
    const auto is_hit = [&](size_t t) {
      return naive::IntersectsTriangle(o, d, globe.positions[globe.indices[t]],
                                       globe.positions[globe.indices[t + 1]],
                                       globe.positions[globe.indices[t + 2]]);
    };
    escapes += std::none_of(triangles_at[vertex].begin(), triangles_at[vertex].end(), is_hit);
  }
  return escapes / static_cast<double>(kRays);
}

constexpr int kRings = 200, kSectors = 400;

// G3. Expected by the catalogue: 0 misses among 10^7 rays to vertices, middles of edges and random
// points. Rays start inside a closed mesh around the camera. Without the second test 2 % of the
// rays to vertices escape.
TEST(TriangleStability, G3NoRayLeavesAClosedRoom) {
  const Triangles globe = Globe({0, 0, 0}, kRings, kSectors);
  TestScene t({0, 0, 0}, {0, 0, 1}, 60);
  t.AddShape(MeshShape{t.AddMesh(globe.positions, globe.indices)}, kNone);
  const std::unique_ptr<TracedScene> scene = Traced(t.scene);
  ExpectNoEscape(*scene, globe, FromTheMiddle);
  const Escapes escapes = CountRayEscapes(*scene, globe, Aim::kVertex, FromTheMiddle);
  ExpectHardCase({.row = "G3",
                  .figure = "part of rays to vertices that leave a closed mesh",
                  .expected = 0,
                  .measured = (escapes.rays + escapes.shadow_rays) / (2.0 * RayCount()),
                  .naive = NaiveEscapes(globe),
                  .naive_by = "each triangle tested alone, by Moeller and Trumbore"});
}

// G3: the same for needles; the second test of their hits opens no holes.
TEST(TriangleStability, G3NoRayLeavesAClosedRoomOfNeedles) {
  const Triangles globe = Globe({0, 0, 0}, 4, 1000);
  TestScene t({0, 0, 0}, {0, 0, 1}, 60);
  t.AddShape(MeshShape{t.AddMesh(globe.positions, globe.indices)}, kNone);
  ASSERT_TRUE(HasNeedles(globe.positions, globe.indices));
  ExpectNoEscape(*Traced(t.scene), globe, FromTheMiddle);
}

// G3: the room may consist of several meshes; here open ones share their borders.
TEST(TriangleStability, G3NoRayLeavesARoomOfOpenMeshes) {
  const Triangles globe = Globe({0, 0, 0}, kRings, kSectors);
  constexpr size_t kMeshes = 7;
  TestScene t({0, 0, 0}, {0, 0, 1}, 60);
  const size_t triangles = globe.indices.size() / 3;
  for (size_t i = 0; i < kMeshes; ++i) {
    const auto at = [&](size_t mesh) {
      return globe.indices.begin() + static_cast<std::ptrdiff_t>(triangles * mesh / kMeshes * 3);
    };
    const std::vector<uint32_t> indices(at(i), at(i + 1));
    ASSERT_EQ(EnclosedSideOf(globe.positions, indices), EnclosedSide::kNeither);
    t.AddShape(MeshShape{t.AddMesh(globe.positions, indices)}, kNone);
  }
  ExpectNoEscape(*Traced(t.scene), globe, FromTheMiddle);
}

TEST(TriangleStability, G3NoRayLeavesARoomOfSixWalls) {
  TestScene t({0, 0, 0}, {0, 0, 1}, 60);
  const int32_t box = t.Box({-1.1f, -0.7f, -1.3f}, {0.9f, 1.2f, 0.8f});
  const Triangles room{t.scene.meshes[box].positions, t.scene.meshes[box].indices};
  for (size_t i = 0; i < room.indices.size(); i += 6) {
    const auto first = room.indices.begin() + static_cast<std::ptrdiff_t>(i);
    t.AddShape(MeshShape{t.AddMesh(room.positions, {first, first + 6})}, kNone);
  }
  ExpectNoEscape(*Traced(t.scene), room, FromTheMiddle);
}

// G3: rays that leave a triangle to the inside of its closed mesh, for every camera position, as
// through glass. Front faces outwards and inwards.
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
    ExpectNoEscape(*scene, globe, [&](Random* random) {
      return FromTheInside(globe, {0, 0, 5}, kNotPlaced, random);
    });
  }
}

// G3: the same for a mesh placed by a transform, also mirrored.
TEST(TriangleStability, G3NoRayLeavesAPlacedClosedMeshFromItsInside) {
  for (const double mirror : {1.0, -1.0}) {
    Triangles globe = Globe({0, 0, 0}, kRings, kSectors);
    TestScene t({0, 0, -5}, {0, 0, 0}, 60);
    t.AddLooseShape(MeshShape{t.AddMesh(globe.positions, globe.indices)}, kNone);
    t.scene.objects.push_back({"globe", {0}, {}});
    ObjectInstance instance;
    instance.object = 0;
    instance.world_from_instance.start = instance.world_from_instance.end =
        RotateMatrix(33, {0.2, 1, -0.4}) * ScaleMatrix({mirror * 1.3, 0.8, 1.1});
    t.scene.instances.push_back(instance);
    const std::unique_ptr<TracedScene> scene = Traced(t.scene);
    const BakedMesh& mesh = scene->geometry.groups[1].meshes[0];
    globe.positions = mesh.positions;
    globe.indices = mesh.indices;
    for (Vec3f& p : globe.positions) {
      p = ToFloat(scene->geometry.still[0].render_from_group.Point(ToDouble(p)));
    }
    ExpectNoEscape(*scene, globe, [&](Random* random) {
      return FromTheInside(globe, {0, 0, 5}, 0, random);
    });
  }
}

// G3 without the second test: shadow rays to nearby lights.
// Rays to random points and edges do not escape; one in fifty rays to vertices does.
TEST(TriangleStability, G3UnguardedRaysEscapeOnlyAtVertices) {
  const Triangles globe = Globe({0, 0, 0}, kRings, kSectors);
  TestScene t({0, 0, 0}, {0, 0, 1}, 60);
  t.AddShape(MeshShape{t.AddMesh(globe.positions, globe.indices)}, kNone);
  const std::unique_ptr<TracedScene> scene = Traced(t.scene);
  const auto finite = [](Random* random) {
    Ray ray = FromTheMiddle(random);
    ray.t_max = 1e6f;
    return ray;
  };
  EXPECT_EQ(CountRayEscapes(*scene, globe, Aim::kAnywhere, finite).shadow_rays, 0);
  EXPECT_EQ(CountRayEscapes(*scene, globe, Aim::kEdgeMiddle, finite).shadow_rays, 0);
  const int escapes = CountRayEscapes(*scene, globe, Aim::kVertex, finite).shadow_rays;
  EXPECT_LT(escapes, RayCount() / 40);
}

// Among surfaces at equal distance the one with the smallest id is hit, independent of their order
// in a tree: eight surfaces of one mesh, and eight meshes, behind other triangles that vary the
// tree.
TEST(TriangleStability, TiesResolveToTheSmallestId) {
  const std::vector<Vec3f> corners{{-1, -1.3f, 0.4f}, {1.2f, -1, 0.1f}, {0.1f, 1.4f, -0.3f}};
  const Vec3f normal = Normalize(Cross(corners[1] - corners[0], corners[2] - corners[0]));
  Random random(9);
  for (const bool one_mesh : {true, false}) {
    TestScene t({0, 0, 0}, {0, 0, 1}, 60);
    constexpr uint32_t kCount = 8;
    std::vector<uint32_t> indices;
    for (uint32_t i = 0; i < kCount; ++i) {
      if (!one_mesh) t.AddShape(MeshShape{t.AddMesh(corners, {0, 1, 2})}, kNone);
      indices.insert(indices.end(), {0, 1, 2});
    }
    if (one_mesh) t.AddShape(MeshShape{t.AddMesh(corners, indices)}, kNone);
    const Triangles globe = Globe({0, 0, 5}, 20, 40);
    t.AddShape(MeshShape{t.AddMesh(globe.positions, globe.indices)}, kNone);
    const std::unique_ptr<TracedScene> scene = Traced(t.scene);
    for (int i = 0; i < 10000; ++i) {
      const auto a = static_cast<float>(random.Uniform(0.05, 0.5)),
                 b = static_cast<float>(random.Uniform(0.05, 0.45));
      Ray ray;
      ray.o = random.Direction() * 3;
      ray.d = corners[0] * (1 - a - b) + corners[1] * a + corners[2] * b - ray.o;
      if (std::fabs(Dot(Normalize(ray.d), normal)) < 0.05f) continue;  // Parallel to it.
      ray.t_max = i % 2 == 0 ? ray.t_max : 1.01f;
      RawHit hit;
      ASSERT_TRUE(scene->tracer->Intersect(ray, &hit));
      if (hit.t < 0.99f) continue;  // The globe occludes it.
      ASSERT_EQ(hit.id.geometry, 0U);
      ASSERT_EQ(hit.id.primitive, 0U);
      ASSERT_NEAR(hit.t, 1, 1e-5);
      ASSERT_NEAR(hit.u, a, 1e-5);
      ASSERT_NEAR(hit.v, b, 1e-5);
    }
  }
}

// G3: a room with a window. Rays leave by the window, and nowhere else.
TEST(TriangleStability, G3RoomsWithAWindowLeakNowhereElse) {
  Triangles globe = Globe({0, 0, 0}, kRings, kSectors);
  const size_t walls = globe.indices.size() - 3 * kSectors;  // Without the cap about -z.
  Triangles room{globe.positions, {globe.indices.begin(), globe.indices.begin() + walls}};
  TestScene t({0, 0, 0}, {0, 0, 1}, 60);
  t.AddShape(MeshShape{t.AddMesh(room.positions, room.indices)}, kNone);
  const std::unique_ptr<TracedScene> scene = Traced(t.scene);
  Ray ray;
  RawHit hit;
  ray.d = {0, 0, -1};
  EXPECT_FALSE(scene->tracer->Intersect(ray, &hit));
  // Rays to the rim may pass on either side of it.
  room.indices.resize(walls - 6 * kSectors);
  ExpectNoEscape(*scene, room, FromTheMiddle);
}

// The sides of a cube about the camera, 2 wide, whose wall z = 1 has a slit or a square hole.
void AddRoomWithOpening(TestScene* t, double width, bool is_hole) {
  const auto w = static_cast<float>(width / 2);
  t->AddShape(MeshShape{t->Quad({-1, -1, 1}, {-w, -1, 1}, {-w, 1, 1}, {-1, 1, 1})}, kNone);
  t->AddShape(MeshShape{t->Quad({w, -1, 1}, {1, -1, 1}, {1, 1, 1}, {w, 1, 1})}, kNone);
  if (is_hole) {
    t->AddShape(MeshShape{t->Quad({-w, -1, 1}, {w, -1, 1}, {w, -w, 1}, {-w, -w, 1})}, kNone);
    t->AddShape(MeshShape{t->Quad({-w, w, 1}, {w, w, 1}, {w, 1, 1}, {-w, 1, 1})}, kNone);
  }
  const int32_t box = t->Box({-1, -1, -1}, {1, 1, 1});
  std::vector<uint32_t> others;
  const TriangleMesh mesh = t->scene.meshes[box];
  for (size_t i = 0; i < mesh.indices.size(); i += 3) {
    const auto is_front = [&](uint32_t index) { return mesh.positions[index].z > 0; };
    const uint32_t* k = &mesh.indices[i];
    if (is_front(k[0]) && is_front(k[1]) && is_front(k[2])) continue;
    others.insert(others.end(), k, k + 3);
  }
  t->AddShape(MeshShape{t->AddMesh(mesh.positions, others)}, kNone);
}

// G18: the light that comes through a slit or a hole of a closed room, to the smallest that the
// tracer's rounding leaves open: from the open, and from the walls of a room about the room.
TEST(TriangleStability, G18ClosedRoomsKeepSmallOpenings) {
  double largest = 0;
  for (const double width : {1e-5, 1e-4, 1e-3, 1e-2}) {
    for (const auto& [is_hole, has_outer_room] :
         {std::pair{false, false}, {false, true}, {true, false}, {true, true}}) {
      TestScene t({0, 0, 0}, {0, 0, 1}, 60);
      AddRoomWithOpening(&t, width, is_hole);
      if (has_outer_room) {
        t.AddShape(MeshShape{t.Box({-1.5f, -1.5f, -1.5f}, {1.5f, 1.5f, 1.5f})}, kNone);
      }
      const std::unique_ptr<TracedScene> scene = Traced(t.scene);
      Random random(8);
      const int count = DrawCount(100000, 1000000);
      int left = 0;
      for (int i = 0; i < count; ++i) {
        // Twice as wide and as long as the opening.
        const double y = is_hole ? random.Uniform(-width, width) : random.Uniform(-0.9, 0.9);
        Ray ray;
        ray.d = ToFloat(Vec3d{random.Uniform(-width, width), y, 1});
        RawHit hit;
        const bool hits = scene->tracer->Intersect(ray, &hit) && hit.t < 1.25f;
        if (has_outer_room) ray.t_max = 1.25f;
        EXPECT_EQ(hits, scene->tracer->Occluded(ray));
        left += !hits;
      }
      const double expected = is_hole ? 0.25 : 0.5;
      const double error = std::sqrt(expected * (1 - expected) / count);
      EXPECT_NEAR(left / static_cast<double>(count), expected, 0.002 * expected + 4 * error)
          << width << " " << is_hole << " " << has_outer_room;
      largest = std::max(largest, std::fabs(left / (expected * count) - 1));
    }
  }
  ExpectHardCase({.row = "G18",
                  .figure = "largest relative loss of light through openings of 1e-5 to 1e-2",
                  .expected = 0,
                  .measured = largest,
                  .tolerance = 0.02});
}

// The same exactly at the edges, where statistics of the whole opening see little: rays that pass a
// slit's edge on either side, by less than the tracer's rounding.
TEST(TriangleStability, G18EdgesOfOpeningsAreExact) {
  constexpr double kWidth = 1e-5;
  TestScene t({0, 0, 0}, {0, 0, 1}, 60);
  AddRoomWithOpening(&t, kWidth, false);
  t.AddShape(MeshShape{t.Box({-1.5f, -1.5f, -1.5f}, {1.5f, 1.5f, 1.5f})}, kNone);
  const std::unique_ptr<TracedScene> scene = Traced(t.scene);
  const auto edge = static_cast<float>(kWidth / 2);
  Random random(9);
  for (int i = 0; i < DrawCount(20000, 1000000); ++i) {
    Ray ray;
    ray.d = ToFloat(Vec3d{static_cast<double>(edge) + random.Uniform(-1e-7, 1e-7),
                          random.Uniform(-0.9, 0.9), 1});
    RawHit hit;
    ASSERT_TRUE(scene->tracer->Intersect(ray, &hit));
    ray.t_max = 1.25f;
    ASSERT_EQ(hit.t > 1.25f, ray.d.x < edge) << ray.d.x;
    ASSERT_EQ(scene->tracer->Occluded(ray), ray.d.x >= edge) << ray.d.x;
  }
}

TEST(TriangleStability, G3ClosedMeshesAreDetectedByEdges) {
  const auto side = [](const Triangles& t) { return EnclosedSideOf(t.positions, t.indices); };
  Triangles globe = Globe({3, -2, 7}, 8, 12);
  EXPECT_EQ(side(globe), EnclosedSide::kBack);
  // Seams: each triangle has its own corners.
  Triangles torn;
  for (const uint32_t index : globe.indices) {
    torn.indices.push_back(static_cast<uint32_t>(torn.positions.size()));
    torn.positions.push_back(globe.positions[index]);
  }
  EXPECT_EQ(side(torn), EnclosedSide::kBack);
  for (size_t i = 0; i < torn.indices.size(); i += 3)
    std::swap(torn.indices[i], torn.indices[i + 1]);
  EXPECT_EQ(side(torn), EnclosedSide::kFront);
  // A missing or a flipped triangle makes a border.
  Triangles open = globe;
  open.indices.resize(open.indices.size() - 3);
  EXPECT_EQ(side(open), EnclosedSide::kNeither);
  std::swap(globe.indices[0], globe.indices[1]);
  EXPECT_EQ(side(globe), EnclosedSide::kNeither);
  EXPECT_EQ(side({}), EnclosedSide::kNeither);
}

}  // namespace
}  // namespace sheaf::render
