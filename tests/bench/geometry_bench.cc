// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// geometry_bench [INSTANCES] [CURVES] [SECONDS_MAX] [BYTES_MAX]: time and memory for baking and
// building a million instances and a hundred thousand curves on one thread, and the rate of rays
// traced in them. Prints the memory that the scene reports and the growth of the process. Exits
// with 1 if either scene takes longer than SECONDS_MAX to build, or if the process grows by more
// than BYTES_MAX per instance or per curve segment.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "common/math/elementary.h"
#include "tests/bench/measures.h"
#include "worker/render/accel/embree_scene.h"
#include "worker/render/scene/scene_baker.h"

namespace sheaf::render {
namespace {

constexpr int kSegmentsPerCurve = 4;
constexpr int kRays = 400000;

class Random {
 public:
  double Uniform(double a, double b) {
    return a + (b - a) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }
  Vec3d Direction() {
    const double z = Uniform(-1, 1), phi = Uniform(0, 2 * kPi), r = std::sqrt(1 - z * z);
    return {r * Cos(phi), r * Sin(phi), z};
  }

 private:
  std::mt19937_64 engine_{3};
};

// A small ball of triangles, instanced at random in a cube of half-size 1.
SceneDescription Instances(uint64_t count) {
  SceneDescription scene;
  Random random;
  TriangleMesh ball;
  constexpr int kRings = 8, kSectors = 16;
  for (int r = 0; r <= kRings; ++r) {
    for (int s = 0; s < kSectors; ++s) {
      const double theta = kPi * r / kRings, phi = 2 * kPi * s / kSectors;
      ball.positions.push_back(ToFloat({Sin(theta) * Cos(phi), Sin(theta) * Sin(phi), Cos(theta)}));
    }
  }
  for (uint32_t r = 0; r < kRings; ++r) {
    for (uint32_t s = 0; s < kSectors; ++s) {
      const uint32_t a = r * kSectors + s, b = r * kSectors + (s + 1) % kSectors;
      ball.indices.insert(ball.indices.end(), {a, a + kSectors, b + kSectors, a, b + kSectors, b});
    }
  }
  scene.meshes.push_back(std::move(ball));
  ShapeDescription shape;
  shape.shape = MeshShape{0};
  scene.shapes.push_back(shape);
  scene.objects.push_back({"ball", {0}, {}});
  const double size = 0.5 / std::cbrt(static_cast<double>(count));
  for (uint64_t i = 0; i < count; ++i) {
    ObjectInstance instance;
    instance.object = 0;
    const Matrix4 place =
        TranslateMatrix({random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(-1, 1)}) *
        RotateMatrix(random.Uniform(0, 360), random.Direction()) *
        ScaleMatrix({size, size * random.Uniform(0.5, 1), size});
    instance.world_from_instance.start = instance.world_from_instance.end = place;
    scene.instances.push_back(instance);
  }
  return scene;
}

// Hairs that grow from a ball of radius 0.5, 0.4 long and a thousandth of that thick.
SceneDescription Curves(uint64_t count) {
  SceneDescription scene;
  Random random;
  CurveSet set;
  for (uint64_t i = 0; i < count; ++i) {
    const Vec3d root = random.Direction() * 0.5;
    const Vec3d step = (root * 2.0 + random.Direction() * 0.3) * (0.4 / (3 * kSegmentsPerCurve));
    Vec3d at = root, bend = random.Direction() * 0.01;
    for (int k = 0; k < kSegmentsPerCurve; ++k) {
      for (int c = 0; c < 4; ++c) {
        set.points.push_back(ToFloat(at));
        if (c < 3) at += step + bend;
      }
      bend = bend + random.Direction() * 0.004;
      set.widths.insert(set.widths.end(), {4e-4f, 4e-4f});
    }
  }
  scene.curve_sets.push_back(std::move(set));
  ShapeDescription shape;
  shape.shape = CurveShape{0};
  scene.shapes.push_back(shape);
  scene.world_shapes.push_back(0);
  return scene;
}

bool Measure(const std::string& name, uint64_t count, SceneDescription scene, double seconds_max,
             double bytes_max) {
  scene.camera.shutter_close = scene.camera.shutter_open;
  const double memory_before = ResidentBytes();
  const double begin = ProcessCpuSeconds();
  absl::StatusOr<BakedScene> baked = BakeScene(&scene);
  if (!baked.ok()) {
    std::fprintf(stderr, "%s\n", baked.status().ToString().c_str());
    return false;
  }
  const double baked_at = ProcessCpuSeconds();
  absl::StatusOr<std::unique_ptr<EmbreeScene>> tracer = EmbreeScene::Build(baked->geometry, 1);
  if (!tracer.ok()) {
    std::fprintf(stderr, "%s\n", tracer.status().ToString().c_str());
    return false;
  }
  const double built_at = ProcessCpuSeconds();
  const double grown = ResidentBytes() - memory_before;
  Random random;
  std::vector<RecordedRay> rays(kRays);
  for (RecordedRay& r : rays) {
    r.ray.o = ToFloat(random.Direction() * 2.0);
    r.ray.d = ToFloat(random.Direction() * 0.8) - r.ray.o;
  }
  const double trace_begin = ProcessCpuSeconds();
  const uint64_t hits = (*tracer)->Replay(rays);
  const double rate = kRays / (ProcessCpuSeconds() - trace_begin);
  const double seconds = built_at - begin, bytes = grown / static_cast<double>(count);
  std::printf(
      "%s: %llu; baked in %.2f s, built in %.2f s; %.0f bytes each in the process, %.0f of them "
      "Embree's; %.3f million rays/s, %.0f %% of them met something\n",
      name.c_str(), static_cast<unsigned long long>(count), baked_at - begin, built_at - baked_at,
      bytes, static_cast<double>((*tracer)->memory_bytes()) / static_cast<double>(count),
      rate * 1e-6, 100 * static_cast<double>(hits) / kRays);
  return seconds <= seconds_max && bytes <= bytes_max;
}

int Main(int argc, char** argv) {
  const uint64_t instances = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 1000000;
  const uint64_t curves = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 100000;
  const double seconds_max = argc > 3 ? std::atof(argv[3]) : HUGE_VAL;
  const double bytes_max = argc > 4 ? std::atof(argv[4]) : HUGE_VAL;
  bool is_good = Measure("instances", instances, Instances(instances), seconds_max, bytes_max);
  is_good = Measure("segments of curves", curves * kSegmentsPerCurve, Curves(curves), seconds_max,
                    bytes_max) &&
            is_good;
  return is_good ? 0 : 1;
}

}  // namespace
}  // namespace sheaf::render

int main(int argc, char** argv) { return sheaf::render::Main(argc, argv); }
