// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of cylinders and bilinear patches, named as in the catalogue (G1 to G11). Those of
// spheres and triangles are in geometry_stability_test.cc.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/math/transform.h"
#include "gtest/gtest.h"
#include "tests/support/test_scene.h"
#include "tests/support/traced_scene.h"
#include "worker/render/geometry/quadric.h"
#include "worker/render/geometry/surface_point.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {
namespace {

TestScene CameraAtOrigin() { return TestScene({0, 0, 0}, {0, 0, 1}, 60); }

BilinearMeshShape AddPatches(TestScene* t, std::vector<Vec3f> positions,
                             std::vector<uint32_t> indices = {0, 1, 2, 3}) {
  BilinearMesh mesh;
  mesh.positions = std::move(positions);
  mesh.indices = std::move(indices);
  t->scene.bilinear_meshes.push_back(std::move(mesh));
  return {static_cast<int32_t>(t->scene.bilinear_meshes.size() - 1)};
}
// Corners of a cube of half-size 1, each moved by up to `wobble`: its six faces are curved and its
// edges straight, so it is closed.
std::vector<Vec3f> WobblyCorners(float wobble) {
  Random random(7);
  std::vector<Vec3f> corners;
  for (int i = 0; i < 8; ++i) {
    corners.push_back(Vec3f{i & 1 ? 1.0f : -1.0f, i & 2 ? 1.0f : -1.0f, i & 4 ? 1.0f : -1.0f} +
                      random.Direction() * wobble);
  }
  return corners;
}
// Front faces point outwards.
const std::vector<uint32_t> kCubePatches{0, 2, 1, 3, 4, 5, 6, 7, 0, 1, 4, 5,
                                         2, 6, 3, 7, 0, 4, 2, 6, 1, 3, 5, 7};
// Adds a cylinder about the z axis and two disks that close it.
void AddCan(TestScene* t, int32_t material, const Matrix4& place) {
  t->AddShape(CylinderShape{0.7f, -0.9f, 1.1f, 360}, material, place);
  for (const float height : {-0.9f, 1.1f}) {
    DiskShape lid;
    lid.radius = 0.7f;
    lid.height = height;
    t->AddShape(lid, material, place).reverse_orientation = height < 0;
  }
}

// G1: rays that leave a cylinder outwards miss it, rays into it hit its far side, for every
// position, size and rotation.
TEST(CurvedShapeStability, G1SpawnedRaysStayOnTheirSideOfACylinder) {
  Random random(1);
  int spawned = 0, wrong = 0;
  for (int i = 0; i < 1000; ++i) {
    TestScene t = CameraAtOrigin();
    const double radius = std::pow(10.0, random.Uniform(-3, 5));
    const Vec3d center = ToDouble(random.Direction()) * std::pow(10.0, random.Uniform(-3, 8));
    const auto length = static_cast<float>(100 * radius);
    const CylinderShape cylinder{static_cast<float>(radius), -length, length, 360};
    const Matrix4 place = TranslateMatrix(center) *
                          RotateMatrix(random.Uniform(0, 360), ToDouble(random.Direction())) *
                          ScaleMatrix({random.Uniform(0.5, 2), random.Uniform(0.5, 2), 1});
    t.AddShape(cylinder, kNone, place);
    const std::unique_ptr<TracedScene> scene = Traced(t.scene);
    const Vec3d axis = TransformVector(place, {0, 0, 1});
    const Vec3d out = Cross(axis, ToDouble(random.Direction()));
    if (Length(out) < 0.1) continue;
    SurfacePoint point;
    const Vec3d outside = center + out * (5 * radius / Length(out));
    if (!HitTowards(*scene, ToFloat(outside), ToFloat(center), &point)) continue;
    // If floats cannot distinguish the cylinder from its axis, there is no inside to test.
    if (radius < 64 * static_cast<double>(Length(point.p_error))) continue;
    for (int k = 0; k < 500; ++k) {
      const Vec3f direction = random.Direction();
      const float cosine = Dot(direction, point.ng);
      // Nearly tangent rays may go either way; those along the axis pass through the ends.
      if (std::fabs(cosine) < 1e-3f || Length(Cross(axis, ToDouble(direction))) < 0.1) continue;
      RawHit hit;
      ++spawned;
      wrong += scene->tracer->Intersect(Spawned(point, direction), &hit) != (cosine < 0);
    }
  }
  EXPECT_GE(spawned, 200000);
  EXPECT_EQ(wrong, 0);
}

// G1: rays from a patch do not hit it at their origin. It may bend into their path farther away.
TEST(CurvedShapeStability, G1SpawnedRaysDoNotHitTheirPatch) {
  Random random(2);
  int spawned = 0, self_hits = 0;
  for (int i = 0; i < 2000; ++i) {
    TestScene t = CameraAtOrigin();
    const Vec3f base = random.Direction() * std::fabs(random.AnyMagnitude());
    const double scale = static_cast<double>(Length(base)) * std::pow(10.0, random.Uniform(-3, 4));
    std::vector<Vec3f> corners;
    for (int k = 0; k < 4; ++k) {
      corners.push_back(base + random.Direction() * static_cast<float>(scale));
    }
    const BilinearPatch patch{ToDouble(corners[0]), ToDouble(corners[1]), ToDouble(corners[2]),
                              ToDouble(corners[3])};
    t.AddShape(AddPatches(&t, corners), kNone);
    const std::unique_ptr<TracedScene> scene = Traced(t.scene);
    const Vec3f middle = ToFloat(patch.PointAt(random.Uniform(), random.Uniform()));
    SurfacePoint point;
    RawHit start;
    if (!HitTowards(*scene, middle + random.Direction() * static_cast<float>(3 * scale), middle,
                    &point, &start)) {
      continue;
    }
    // If it is creased nearly to a line, its side is undefined.
    const Vec3d n = patch.NormalAt(static_cast<double>(start.u), static_cast<double>(start.v));
    if (Length(n) < 0.1 * scale * scale) continue;
    for (int k = 0; k < 500; ++k) {
      const Vec3f direction = random.Direction();
      if (std::fabs(Dot(direction, point.ng)) < 0.05f) continue;
      Ray away = Spawned(point, direction);
      away.t_max = static_cast<float>(1e-4 * scale);
      RawHit hit;
      ++spawned;
      self_hits += scene->tracer->Intersect(away, &hit) || scene->tracer->Occluded(away);
    }
  }
  EXPECT_GE(spawned, 300000);
  EXPECT_EQ(self_hits, 0);
}

// G2: scaling by powers of two changes no bit.
TEST(CurvedShapeStability, G2PowersOfTwoChangeNoBit) {
  const auto room = [](double scale) {
    TestScene t = LitRoom(scale);
    const Matrix4 size = ScaleMatrix({scale, scale, scale});
    t.AddShape(CylinderShape{0.2f, -0.3f, 0.3f, 250}, t.Diffuse(Rgb::Gray(0.6f)),
               size * TranslateMatrix({-0.4, -0.3, 0.5}) * RotateMatrix(70, {1, 2, 3}));
    t.AddShape(
        AddPatches(&t,
                   {{-0.5f, 0, 0.6f}, {0.5f, 0.2f, 0.6f}, {-0.5f, 0.5f, 0.3f}, {0.5f, 0.4f, 0.9f}}),
        t.Diffuse({0.2f, 0.8f, 0.3f}), size);
    return RenderAll(*Compile(t.scene, SquareSettings(12, 16, 5)));
  };
  const FilmTile still = room(1);
  EXPECT_GT(MeanOf(still).mean.r, 0);
  for (const int exponent : {-20, -10, 10, 23}) {
    const FilmTile scaled = room(std::ldexp(1.0, exponent));
    for (const FilmChannel c : {FilmChannel::kRedHi, FilmChannel::kGreenHi, FilmChannel::kBlueHi}) {
      EXPECT_TRUE(
          std::equal(still.channel(c), still.channel(c) + still.plane_size(), scaled.channel(c)))
          << "2^" << exponent;
    }
  }
}

// G3: no ray leaves a closed room of curved patches, whichever corner or edge it is aimed at.
TEST(CurvedShapeStability, G3NoRayLeavesARoomOfPatches) {
  for (const float wobble : {0.0f, 0.3f}) {
    SCOPED_TRACE(wobble);
    TestScene t = CameraAtOrigin();
    const std::vector<Vec3f> corners = WobblyCorners(wobble);
    t.AddShape(AddPatches(&t, corners, kCubePatches), kNone, ScaleMatrix({3, 2, 1}));
    const std::unique_ptr<TracedScene> scene = Traced(t.scene);
    Random random(3);
    int escapes = 0;
    for (int i = 0; i < 100000; ++i) {
      const uint32_t* k = &kCubePatches[4 * static_cast<size_t>(random.Uniform(0, 6))];
      const Vec3f a = corners[k[0]], b = corners[k[1]];
      const Vec3f target = i % 3 == 0   ? a
                           : i % 3 == 1 ? (a + b) * 0.5f
                                        : a + (b - a) * static_cast<float>(random.Uniform());
      Ray ray;
      ray.o = random.Direction() * 0.3f;
      ray.d = target * Vec3f{3, 2, 1} - ray.o;
      RawHit hit;
      escapes += !scene->tracer->Intersect(ray, &hit) || !scene->tracer->Occluded(ray);
    }
    EXPECT_EQ(escapes, 0);
  }
}

// G3: no ray leaves a closed cylinder through its rims.
TEST(CurvedShapeStability, G3NoRayLeavesACan) {
  TestScene t = CameraAtOrigin();
  AddCan(&t, kNone, RotateMatrix(33, {3, 1, 2}));
  const std::unique_ptr<TracedScene> scene = Traced(t.scene);
  Random random(4);
  int escapes = 0;
  for (int i = 0; i < 100000; ++i) {
    const double phi = random.Uniform(0, 2 * std::numbers::pi);
    const Vec3d rim{0.7 * std::cos(phi), 0.7 * std::sin(phi),
                    static_cast<double>(i % 2 == 0 ? -0.9f : 1.1f)};
    Ray ray;
    ray.o = random.Direction() * 0.3f;
    ray.d = ToFloat(TransformPoint(RotateMatrix(33, {3, 1, 2}), rim)) - ray.o;
    RawHit hit;
    escapes += !scene->tracer->Intersect(ray, &hit) || !scene->tracer->Occluded(ray);
  }
  EXPECT_EQ(escapes, 0);
}

// G7: the front of a mirrored shape stays the front of the original; reverse_orientation flips it.
TEST(CurvedShapeStability, G7MirroringKeepsTheFront) {
  for (const bool mirrors : {false, true}) {
    for (const bool reverses : {false, true}) {
      const Matrix4 place = TranslateMatrix({0, 0, 4}) * RotateMatrix(20, {1, 2, 3}) *
                            ScaleMatrix({mirrors ? -1.5 : 1.5, 1, 0.5});
      TestScene t = CameraAtOrigin();
      t.AddShape(CylinderShape{1, -2, 2, 360}, kNone, place).reverse_orientation = reverses;
      std::unique_ptr<TracedScene> scene = Traced(t.scene);
      SurfacePoint point;
      const Vec3d wall = TransformPoint(place, {0.6, 0.8, 0.5}),
                  out = TransformVector(place, {0.6, 0.8, 0});
      ASSERT_TRUE(HitTowards(*scene, ToFloat(wall + out), ToFloat(wall - out), &point));
      EXPECT_EQ(Dot(point.ng, ToFloat(out)) > 0, !reverses);
      TestScene p = CameraAtOrigin();
      p.AddShape(AddPatches(&p, {{-1, -1, 0}, {1, -1, 0.5f}, {-1, 1, 0}, {1, 1, -0.5f}}), kNone,
                 place)
          .reverse_orientation = reverses;
      scene = Traced(p.scene);
      const Vec3d on = TransformPoint(place, {0, 0, 0}), up = TransformVector(place, {0, 0, 1});
      ASSERT_TRUE(HitTowards(*scene, ToFloat(on + up), ToFloat(on - up), &point));
      EXPECT_EQ(Dot(point.ng, ToFloat(up)) > 0, !reverses);
    }
  }
}

// G8: a white trapezoid under a white sky is white from every grazing view.
TEST(CurvedShapeStability, G8GrazingPatchKeepsItsEnergy) {
  for (int k = 1; k <= 6; k += 1) {
    SCOPED_TRACE(k);
    TestScene t({0, std::pow(10.0, -k), 0}, {1, 0, 0}, 60);
    t.scene.camera.kind = CameraDescription::Kind::kOrthographic;
    for (int i = 0; i < 4; ++i) t.scene.camera.screen_window[i] *= 1e-8;
    t.AddShape(AddPatches(&t, {{-50, 0, -50}, {-50, 0, 60}, {50, 0, -50}, {50, 0, 50}}),
               t.Diffuse(Rgb::Gray(1)));
    t.ConstantEnvironment(Rgb::Gray(1));
    ExpectMean(RenderMean(t.scene, SquareSettings(4, 256, 5)), Rgb::Gray(1));
  }
}

// G11: a cylinder of radius 1 seen from far away, at impact parameter 0.5.
TEST(CurvedShapeStability, G11FarCylindersAreHitAccurately) {
  const Quadric cylinder = MakeQuadric(CylinderShape{1, -1, 1, 360});
  for (const double distance : {1e4, 1e5, 1e6, 1e8}) {
    const std::optional<double> t =
        IntersectQuadric(cylinder, {-distance, 0.5, 0.25}, {1, 0, 0}, HUGE_VAL);
    ASSERT_TRUE(t.has_value());
    EXPECT_NEAR(*t, distance - std::sqrt(0.75), 4e-16 * distance);
    const QuadricPoint point = QuadricPointAt(cylinder, {-distance, 0.5, 0.25}, {1, 0, 0}, *t);
    EXPECT_NEAR(std::hypot(point.p.x, point.p.y), 1, 1e-15);
    EXPECT_NEAR(point.p.y, 0.5, 1e-15 + 1e-15 * distance);
    EXPECT_EQ(point.p.z, 0.25);
  }
}

// A closed set of these shapes lets nothing in: no ray of a bright sky reaches the camera.
TEST(CurvedShapeStability, ClosedShapesAreDarkInside) {
  TestScene can({0.1, 0.2, 0}, {0.1, 0.3, 1}, 90);
  AddCan(&can, can.Diffuse(Rgb::Gray(0.9f)), RotateMatrix(33, {3, 1, 2}));
  TestScene room({0.1, 0.2, 0}, {0.1, 0.3, 1}, 90);
  room.AddShape(AddPatches(&room, WobblyCorners(0.3f), kCubePatches),
                room.Diffuse(Rgb::Gray(0.9f)));
  for (TestScene* t : {&can, &room}) {
    t->ConstantEnvironment(Rgb::Gray(1e6f));
    const TileMean mean = RenderMean(t->scene, SquareSettings(16, 64, 20));
    EXPECT_EQ(mean.non_finite, 0u);
    EXPECT_EQ(mean.mean.g, 0);
  }
}

// A rectangular light is the same to the bit as a patch and as two triangles, and the plan does not
// count it as a curved shape.
TEST(CurvedShapeStability, RectanglesEmitAsTriangles) {
  const auto room = [](bool as_patch) {
    TestScene t({0, 0, -3}, {0, 0, 0}, 60);
    t.AddShape(MeshShape{t.Quad({-2, -1, -2}, {-2, -1, 2}, {2, -1, 2}, {2, -1, -2})},
               t.Diffuse(Rgb::Gray(0.7f)));
    const Vec3f a{-0.5f, 1, -0.5f}, b{0.5f, 1, -0.5f}, c{0.5f, 1, 0.5f}, d{-0.5f, 1, 0.5f};
    const int32_t black = t.Diffuse({}), light = t.AreaLight(Rgb::Gray(3));
    if (as_patch) {
      t.AddShape(AddPatches(&t, {a, b, d, c}), black).area_light = light;
    } else {
      t.AddShape(MeshShape{t.Quad(a, b, c, d)}, black).area_light = light;
    }
    return t;
  };
  const FrameSettings settings = SquareSettings(12, 16, 4);
  const CompiledScenePtr patch = Compile(room(true).scene, settings);
  EXPECT_EQ(PlanOf(*patch).traits, static_cast<TraitBits>(Trait::kAreaLights));
  const FilmTile image = RenderAll(*patch);
  EXPECT_GT(MeanOf(image).mean.g, 0.01f);
  EXPECT_TRUE(image == RenderAll(*Compile(room(false).scene, settings)));
}

// Shapes that cannot emit are refused by name, with their location.
TEST(CurvedShapeStability, UnsupportedLightsAreRefused) {
  TestScene patch = LitRoom(1);
  patch.AddShape(AddPatches(&patch, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 1}}), 0).area_light =
      0;
  patch.scene.shapes.back().location = {0, 7, 1};
  TableFileSource files({});
  const auto compiled = CompileScene(patch.scene, SquareSettings(4, 1, 1), files);
  ASSERT_FALSE(compiled.ok());
  EXPECT_EQ(
      std::string(compiled.status().message()).find("test.pbrt:7:1: Shape \"bilinearmesh\": "), 0u)
      << compiled.status();
}

}  // namespace
}  // namespace sheaf::render
