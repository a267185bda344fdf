// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of meshes that deform while the shutter is open: leaks, needles, time steps, still
// meshes.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "common/scene/pbrt/statements/mesh_parameters.h"
#include "gtest/gtest.h"
#include "tests/support/globe.h"
#include "tests/support/long_tests.h"
#include "tests/support/test_scene.h"
#include "tests/support/traced_scene.h"
#include "worker/render/geometry/deforming_mesh.h"
#include "worker/render/geometry/leak_guard.h"
#include "worker/render/geometry/needle.h"

namespace sheaf::render {
namespace {

TestScene OpenShutter(Vec3d eye = {0, 0, 0}) {
  TestScene t(eye, eye + Vec3d{0, 0, 1}, 60);
  t.scene.camera.shutter_close = 1;
  return t;
}
// Vertices at equal positions move alike.
Vec3f Wobbled(Vec3f p, int step, float amount) {
  const Vec3d q = ToDouble(p) * 17.0 + Vec3d{1.0, 2.0, 3.0} * static_cast<double>(step);
  return p + Vec3f{static_cast<float>(std::sin(q.x + q.y)), static_cast<float>(std::sin(q.y - q.z)),
                   static_cast<float>(std::cos(q.z + q.x))} *
                 amount;
}
void AddSteps(TriangleMesh* mesh, int count, float amount) {
  for (int step = 1; step <= count; ++step) {
    VertexStep later;
    for (const Vec3f& p : mesh->positions) later.positions.push_back(Wobbled(p, step, amount));
    mesh->steps.push_back(std::move(later));
  }
}

// Traces rays at random times from inside to the present positions of triangles: vertices, middles
// of edges and random points.
int CountEscapes(const TracedScene& scene, const BakedMesh& mesh, Vec3f center) {
  Random random(6);
  int escapes = 0;
  for (int i = 0; i < DrawCount(30000, 3000000); ++i) {
    const auto triangle =
        static_cast<size_t>(random.Uniform() * static_cast<double>(mesh.indices.size() / 3));
    Ray ray;
    ray.time =
        i % 5 == 0 ? 0.25f * static_cast<float>(i % 4) : static_cast<float>(random.Uniform());
    const std::array<Vec3d, 3> p = CornersAt(mesh, &mesh.indices[3 * triangle], ray.time);
    ray.o = center + random.Direction() * 0.2f;
    const Vec3d target = i % 3 == 0   ? p[0]
                         : i % 3 == 1 ? (p[0] + p[1]) * 0.5
                                      : p[0] * 0.2 + p[1] * 0.3 + p[2] * 0.5;
    ray.d = ToFloat(target - ToDouble(ray.o));
    RawHit hit;
    escapes += !scene.tracer->Intersect(ray, &hit);
    escapes += !scene.tracer->Occluded(ray);
  }
  return escapes;
}

// No ray leaves a closed room that deforms, made of well-shaped triangles or of needles.
TEST(DeformationStability, NoRayLeavesADeformingRoom) {
  for (const auto& [rings, sectors] : {std::pair{40, 80}, std::pair{4, 1000}}) {
    const Triangles globe = Globe({0, 0, 0}, rings, sectors);
    TestScene t = OpenShutter();
    const int32_t mesh = t.AddMesh(globe.positions, globe.indices);
    AddSteps(&t.scene.meshes[static_cast<size_t>(mesh)], 3, 0.02f);
    t.AddShape(MeshShape{mesh}, kNone);
    const std::unique_ptr<TracedScene> scene = Traced(t.scene);
    const BakedMesh& baked = scene->geometry.groups[0].meshes[0];
    ASSERT_EQ(baked.steps.size(), 3u);
    EXPECT_EQ(EnclosedSideOf(baked), EnclosedSide::kBack);
    EXPECT_EQ(CountEscapes(*scene, baked, {0, 0, 0}), 0) << rings;
  }
}

// In a position far from the camera, the tracer's corners deviate by more than the distance between
// triangles and rays, but there are still no leaks.
TEST(DeformationStability, NoRayLeavesADistantDeformingRoom) {
  const Vec3d center{3000, 200, -1000};
  const Triangles globe = Globe(center, 20, 40);
  TestScene t = OpenShutter();
  const int32_t mesh = t.AddMesh(globe.positions, globe.indices);
  AddSteps(&t.scene.meshes[static_cast<size_t>(mesh)], 2, 0.01f);
  t.AddShape(MeshShape{mesh}, kNone);
  const std::unique_ptr<TracedScene> scene = Traced(t.scene);
  const BakedMesh& baked = scene->geometry.groups[0].meshes[0];
  Random random(7);
  int escapes = 0;
  for (int i = 0; i < DrawCount(30000, 3000000); ++i) {
    const auto at = [&] {
      return static_cast<uint32_t>(random.Uniform() *
                                   static_cast<double>(baked.indices.size() / 3));
    };
    const uint32_t from = at(), to = at();
    Ray ray;
    ray.time = static_cast<float>(random.Uniform());
    const auto p = CornersAt(baked, &baked.indices[3 * size_t{from}], ray.time);
    const auto q = CornersAt(baked, &baked.indices[3 * size_t{to}], ray.time);
    const Vec3d on = p[0] * 0.3 + p[1] * 0.3 + p[2] * 0.4;
    ray.o = ToFloat(on + (center - on) * 0.01);
    ray.d = ToFloat((i % 2 == 0 ? q[0] : (q[0] + q[1]) * 0.5) - ToDouble(ray.o));
    if (Length(ray.d) < 0.2f) continue;
    ray.source = {0, from, kNotPlaced};
    RawHit hit;
    escapes += !scene->tracer->Intersect(ray, &hit);
  }
  EXPECT_EQ(escapes, 0);
}

// A floor that rises from 0 to 1 in half the shutter interval and then stays: hits are at its
// position in double precision.
TEST(DeformationStability, PointsLieOnTheSurfaceAtTheirTime) {
  TestScene t = OpenShutter({0, 3, 0});
  const int32_t mesh = t.Quad({-9, 0, -9}, {-9, 0, 9}, {9, 0, 9}, {9, 0, -9});
  VertexStep up{t.scene.meshes[static_cast<size_t>(mesh)].positions, {}};
  for (Vec3f& p : up.positions) p.y = 1;
  t.scene.meshes[static_cast<size_t>(mesh)].steps = {up, up};
  t.AddShape(MeshShape{mesh}, kNone);
  const std::unique_ptr<TracedScene> scene = Traced(t.scene);
  Random random(3);
  for (int i = 0; i < 1000; ++i) {
    Ray ray;
    ray.time = static_cast<float>(random.Uniform());
    ray.d = {static_cast<float>(random.Uniform(-1, 1)), -1,
             static_cast<float>(random.Uniform(-1, 1))};
    RawHit hit;
    ASSERT_TRUE(scene->tracer->Intersect(ray, &hit));
    const SurfacePoint point = MakeSurfacePoint<kAllTraits>(scene->geometry, ray, hit);
    // Render space begins at the camera.
    const double expected = std::min(2.0 * static_cast<double>(ray.time), 1.0) - 3;
    EXPECT_NEAR(point.p.y, expected, 2 * 0x1p-24 * 3);
    EXPECT_EQ(point.ng, (Vec3f{0, 1, 0}));
    // The ray leaves it without hitting it again.
    Ray away = Spawned(point, random.Direction());
    away.time = ray.time;
    EXPECT_FALSE(scene->tracer->Intersect(away, &hit));
  }
}

// Needles that turn and stretch: the distance of every hit from its ray is within the rounding of
// its coordinates, at every time (G4 with deformation).
TEST(DeformationStability, NeedlesAreHitAccurately) {
  Random random(9);
  int hits = 0;
  for (int i = 0; i < 2000; ++i) {
    TestScene t = OpenShutter();
    const auto needle = [&] {
      const Vec3f base = random.Direction() * 5.0f, tip = base + random.Direction();
      const auto slimness = static_cast<float>(std::pow(10.0, random.Uniform(-6, -1)));
      return std::vector<Vec3f>{base, tip,
                                base + (tip - base) * 0.4f + random.Direction() * slimness};
    };
    const int32_t mesh = t.AddMesh(needle(), {0, 1, 2});
    t.scene.meshes[static_cast<size_t>(mesh)].steps.push_back({needle(), {}});
    t.AddShape(MeshShape{mesh}, kNone);
    const std::unique_ptr<TracedScene> scene = Traced(t.scene);
    if (scene->geometry.groups[0].meshes.empty()) continue;
    const BakedMesh& baked = scene->geometry.groups[0].meshes[0];
    for (int k = 0; k < 50; ++k) {
      Ray ray;
      ray.time = static_cast<float>(random.Uniform());
      const auto p = CornersAt(baked, baked.indices.data(), ray.time);
      const double u = random.Uniform(0, 0.5), v = random.Uniform(0, 0.5);
      ray.o = random.Direction() * 3.0f;
      ray.d = ToFloat(p[0] * (1 - u - v) + p[1] * u + p[2] * v - ToDouble(ray.o));
      RawHit hit;
      if (!scene->tracer->Intersect(ray, &hit)) continue;
      ++hits;
      const SurfacePoint point = MakeSurfacePoint<kAllTraits>(scene->geometry, ray, hit);
      const Vec3d on_ray = ToDouble(ray.o) + ToDouble(ray.d) * static_cast<double>(hit.t);
      EXPECT_LE(Length(ToDouble(point.p) - on_ray), 0x1p-18 * 6);
    }
  }
  EXPECT_GT(hits, 40000);
}

// An edge that moves by its vertices gives the same ramp as a moving shape (G13).
TEST(DeformationStability, MovingEdgeIsALinearRamp) {
  TestScene t({0, 0, -5}, {0, 0, 0}, 60);
  t.scene.camera.kind = CameraDescription::Kind::kOrthographic;
  t.scene.camera.shutter_close = 1;
  const int32_t mesh = t.Quad({-10, -10, 0}, {-0.5f, -10, 0}, {-0.5f, 10, 0}, {-10, 10, 0});
  TriangleMesh& quad = t.scene.meshes[static_cast<size_t>(mesh)];
  quad.steps.push_back({quad.positions, {}});
  quad.steps[0].positions[1].x = quad.steps[0].positions[2].x = 0.5f;
  t.AddShape(MeshShape{mesh}, t.Diffuse(Rgb::Gray(0.5f)));
  const FrameSettings settings = SquareSettings(16, 256, 0);
  const CompiledScenePtr scene = Compile(t.scene, settings);
  EXPECT_TRUE(Has(PlanOf(*scene).traits, Trait::kDeformation));
  const FilmTile tile = RenderAll(*scene);
  for (int px = 0; px < 16; ++px) {
    double covered = 0;
    for (int py = 0; py < 16; ++py) {
      covered += static_cast<double>(tile.channel(FilmChannel::kAlpha)[py * 16 + px]);
    }
    const double x = -1 + (px + 0.5) / 8;
    // 4096 stratified samples per column: the error of unstratified ones would be 0.008.
    EXPECT_NEAR(covered / (16 * 256), std::clamp(0.5 - x, 0.0, 1.0), 0.02) << px;
  }
}

TestScene RoomOfSteps(bool has_steps) {
  TestScene t = LitRoom(1);
  t.scene.camera.shutter_close = 1;
  TriangleMesh& walls = t.scene.meshes[0];
  if (has_steps) walls.steps.resize(2, VertexStep{walls.positions, {}});
  return t;
}

// Equal time steps are no deformation: the scene equals the still one to the bit. If the steps are
// kept, the tracer treats the mesh as deforming and gives the same image up to rounding.
TEST(DeformationStability, EqualStepsMatchTheStaticMesh) {
  const FrameSettings settings = SquareSettings(12, 64, 3);
  TestScene dropped = RoomOfSteps(true);
  DropEqualSteps(&dropped.scene.meshes[0]);
  const FilmTile still = RenderAll(*Compile(RoomOfSteps(false).scene, settings));
  EXPECT_TRUE(RenderAll(*Compile(dropped.scene, settings)) == still);
  const CompiledScenePtr kept = Compile(RoomOfSteps(true).scene, settings);
  EXPECT_TRUE(Has(PlanOf(*kept).traits, Trait::kDeformation));
  const Rgb a = MeanOf(still).mean, b = MeanOf(RenderAll(*kept)).mean;
  for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(a[c], b[c], 1e-3f * a[c]);
}

// A closed shutter shows the mesh at the opening time, to the bit.
TEST(DeformationStability, ClosedShutterMatchesTheStaticMesh) {
  const FrameSettings settings = SquareSettings(12, 16, 3);
  TestScene t = LitRoom(1);
  AddSteps(&t.scene.meshes[0], 2, 0.1f);
  EXPECT_TRUE(RenderAll(*Compile(t.scene, settings)) ==
              RenderAll(*Compile(LitRoom(1).scene, settings)));
}

TEST(DeformationStability, PowersOfTwoChangeNoBit) {
  const FrameSettings settings = SquareSettings(12, 16, 4);
  const auto room = [](double scale) {
    TestScene t = LitRoom(scale);
    t.scene.camera.shutter_close = 1;
    AddSteps(&t.scene.meshes[0], 2, 0.1f);
    return t;
  };
  const Rgb still = MeanOf(RenderAll(*Compile(room(1).scene, settings))).mean;
  for (const int exponent : {-20, 10}) {
    EXPECT_EQ(MeanOf(RenderAll(*Compile(room(std::ldexp(1.0, exponent)).scene, settings))).mean,
              still);
  }
}

// Deforming meshes can be in object definitions and move as others can.
TEST(DeformationStability, InstancesDeform) {
  const Triangles globe = Globe({0, 0, 0}, 12, 24);
  TestScene t = OpenShutter();
  const int32_t mesh = t.AddMesh(globe.positions, globe.indices);
  AddSteps(&t.scene.meshes[static_cast<size_t>(mesh)], 2, 0.1f);
  t.AddLooseShape(MeshShape{mesh}, kNone);
  t.scene.objects.push_back({"globe", {0}, {}});
  ObjectInstance instance;
  instance.object = 0;
  instance.world_from_instance.start = TranslateMatrix({0, 0, 4});
  instance.world_from_instance.end = TranslateMatrix({1, 0, 4});
  t.scene.instances.push_back(instance);
  const std::unique_ptr<TracedScene> scene = Traced(t.scene);
  const BakedMesh& baked = scene->geometry.groups[1].meshes[0];
  const Vec3d center = scene->geometry.groups[1].center;
  Random random(4);
  for (int i = 0; i < 1000; ++i) {
    const auto triangle = static_cast<uint32_t>(random.Uniform() * 500);
    Ray ray;
    ray.time = static_cast<float>(random.Uniform());
    const auto p = CornersAt(baked, &baked.indices[3 * size_t{triangle}], ray.time);
    const Vec3d target =
        center + (p[0] + p[1] + p[2]) * (1.0 / 3) + Vec3d{static_cast<double>(ray.time), 0, 4};
    ray.d = ToFloat(target);
    RawHit hit;
    ASSERT_TRUE(scene->tracer->Intersect(ray, &hit));
    if (hit.id.primitive != triangle) continue;  // Occluded.
    const SurfacePoint point = MakeSurfacePoint<kAllTraits>(scene->geometry, ray, hit);
    // For a grazing ray its own rounding has the larger effect.
    const double cosine = std::fabs(Dot(ToDouble(point.ng), Normalize(target)));
    EXPECT_LT(Length(ToDouble(point.p) - target) * cosine, 5e-6);
  }
}

TEST(DeformationStability, LightsDoNotDeform) {
  TestScene t = LitRoom(1);
  t.scene.camera.shutter_close = 1;
  AddSteps(&t.scene.meshes[1], 1, 0.1f);
  TableFileSource files({});
  const auto compiled = CompileScene(t.scene, SquareSettings(4, 1, 1), files);
  ASSERT_FALSE(compiled.ok());
  EXPECT_NE(std::string(compiled.status().message()).find("cannot be an area light"),
            std::string::npos);
}

}  // namespace
}  // namespace sheaf::render
