// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TestScene: small scenes built in code for tests with closed-form answers, and the mean of a
// rendered tile with the standard error that z-tests need.
#pragma once

#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "common/film/film_tile.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "gtest/gtest.h"
#include "worker/render/tile_pass.h"

namespace sheaf::render {

class TestScene {
 public:
  SceneDescription scene;

  // A camera at eye, directed to `at`, with a box filter of one pixel.
  TestScene(Vec3d eye, Vec3d at, float fov_degrees, Vec3d up = {0, 1, 0}) {
    scene.files = {"test.pbrt"};
    SetCamera(eye, at, fov_degrees, up);
    scene.filter.kind = FilterDescription::Kind::kBox;
    scene.filter.radius_x_px = scene.filter.radius_y_px = 0.5f;
    scene.camera.shutter_open = scene.camera.shutter_close = 0;
  }
  void SetCamera(Vec3d eye, Vec3d at, float fov_degrees, Vec3d up = {0, 1, 0}) {
    Matrix4 world_from_camera;
    EXPECT_TRUE(LookAtMatrix(eye, at, up, &world_from_camera));
    scene.camera.world_from_camera.start = scene.camera.world_from_camera.end = world_from_camera;
    scene.camera.fov_degrees = fov_degrees;
  }

  int32_t Diffuse(Rgb reflectance) {
    DiffuseMaterial material;
    material.reflectance.value.rgb = reflectance;
    return AddMaterial(material);
  }
  template <typename Material>
  int32_t AddMaterial(Material material) {
    scene.materials.push_back({"", std::move(material), {}});
    return static_cast<int32_t>(scene.materials.size() - 1);
  }
  int32_t AreaLight(Rgb radiance, bool two_sided = false) {
    AreaLightDescription light;
    light.radiance.rgb = radiance;
    light.two_sided = two_sided;
    scene.area_lights.push_back(light);
    return static_cast<int32_t>(scene.area_lights.size() - 1);
  }
  void ConstantEnvironment(Rgb radiance) {
    InfiniteLight light;
    light.radiance.rgb = radiance;
    scene.lights.push_back({light, {}, {}, {}});
  }

  int32_t AddMesh(std::vector<Vec3f> positions, std::vector<uint32_t> indices) {
    TriangleMesh mesh;
    mesh.positions = std::move(positions);
    mesh.indices = std::move(indices);
    scene.meshes.push_back(std::move(mesh));
    return static_cast<int32_t>(scene.meshes.size() - 1);
  }
  // Quad a b c d; it faces the side from which its corners are counterclockwise (right-hand rule).
  int32_t Quad(Vec3f a, Vec3f b, Vec3f c, Vec3f d) {
    return AddMesh({a, b, c, d}, {0, 1, 2, 0, 2, 3});
  }
  // A box from lower to upper with outward front faces.
  int32_t Box(Vec3f lower, Vec3f upper) {
    std::vector<Vec3f> p;
    for (int i = 0; i < 8; ++i) {
      p.push_back(
          {i & 1 ? upper.x : lower.x, i & 2 ? upper.y : lower.y, i & 4 ? upper.z : lower.z});
    }
    return AddMesh(p, {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                       2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5});
  }

  // Adds a shape to the world and returns it for further changes; the reference is valid until the
  // next call.
  template <typename Shape>
  ShapeDescription& AddShape(Shape shape, int32_t material, Matrix4 world_from_object = {}) {
    scene.world_shapes.push_back(static_cast<int32_t>(scene.shapes.size()));
    return AddLooseShape(shape, material, world_from_object);
  }
  // Adds a shape outside the world, for object definitions.
  template <typename Shape>
  ShapeDescription& AddLooseShape(Shape shape, int32_t material, Matrix4 transform = {}) {
    ShapeDescription description;
    description.shape = shape;
    description.material = material;
    description.world_from_object.start = description.world_from_object.end = transform;
    scene.shapes.push_back(description);
    return scene.shapes.back();
  }
};

// A closed room with a ball and a ceiling light, scaled as a whole.
inline TestScene LitRoom(double scale) {
  TestScene t(Vec3d{0.1, 0.2, -0.7} * scale, Vec3d{0, 0, 1} * scale, 70);
  const Matrix4 size = ScaleMatrix({scale, scale, scale});
  t.AddShape(MeshShape{t.Box({-1, -1, -1}, {1, 1, 1})}, t.Diffuse({0.7f, 0.5f, 0.3f}), size);
  t.AddShape(SphereShape{0.25f, -0.25f, 0.25f, 360}, t.Diffuse(Rgb::Gray(0.6f)),
             size * TranslateMatrix({0.3, -0.5, 0.4}));
  const int32_t light = t.AreaLight(Rgb::Gray(5));
  t.AddShape(MeshShape{t.Quad({-0.3f, 0.99f, -0.3f}, {0.3f, 0.99f, -0.3f}, {0.3f, 0.99f, 0.3f},
                              {-0.3f, 0.99f, 0.3f})},
             t.Diffuse({}), size)
      .area_light = light;
  return t;
}

// Random numbers for tests; the seed is part of the test.
class Random {
 public:
  explicit Random(uint64_t seed) : engine_(seed) {}
  double Uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  double Uniform(double a, double b) { return a + (b - a) * Uniform(); }
  // A number of either sign with magnitude 10^U(-8, 8).
  float AnyMagnitude() {
    const double v = std::pow(10.0, Uniform(-8, 8));
    return static_cast<float>(Uniform() < 0.5 ? -v : v);
  }
  Vec3f Direction() {
    const double z = Uniform(-1, 1), phi = Uniform(0, 2 * std::numbers::pi),
                 r = std::sqrt(1 - z * z);
    return ToFloat(Vec3d{r * std::cos(phi), r * std::sin(phi), z});
  }

 private:
  std::mt19937_64 engine_;
};

struct TileMean {
  Rgb mean;
  Rgb standard_error;  // From the replicates.
  uint64_t non_finite = 0;
  uint64_t rays = 0;
};

inline FrameSettings SquareSettings(int32_t size_px, uint64_t samples, int32_t max_depth) {
  FrameSettings settings;
  settings.width_px = settings.height_px = size_px;
  settings.window = {0, 0, size_px, size_px};
  settings.samples = samples;
  settings.max_depth = max_depth;
  return settings;
}

inline CompiledScenePtr Compile(const SceneDescription& scene, const FrameSettings& settings,
                                const CompileTechniques& techniques = {}) {
  TableFileSource files({});
  CompileLimits limits;
  limits.build_threads = 1;
  absl::StatusOr<CompiledScenePtr> compiled =
      CompileScene(scene, settings, files, limits, techniques);
  EXPECT_TRUE(compiled.ok()) << compiled.status();
  return compiled.ok() ? *std::move(compiled) : nullptr;
}

inline FilmTile RenderAll(const CompiledScene& scene, RenderStats* stats = nullptr) {
  const FrameSettings& settings = SettingsOf(scene);
  absl::StatusOr<FilmTile> tile =
      RenderTilePass(scene, settings.window, {0, settings.samples}, {}, stats);
  EXPECT_TRUE(tile.ok()) << tile.status();
  return *std::move(tile);
}

// Mean over all pixels, with its standard error from the spread of the replicates' means.
inline TileMean MeanOf(const FilmTile& tile) {
  TileMean result;
  const size_t n = tile.plane_size();
  double weight = 0;
  for (size_t i = 0; i < n; ++i) {
    weight += tile.channel(FilmChannel::kWeight)[i];
    result.non_finite += static_cast<uint64_t>(tile.channel(FilmChannel::kNonFiniteCount)[i]);
  }
  const FilmChannel high[3] = {FilmChannel::kRedHi, FilmChannel::kGreenHi, FilmChannel::kBlueHi};
  const FilmChannel low[3] = {FilmChannel::kRedLo, FilmChannel::kGreenLo, FilmChannel::kBlueLo};
  for (size_t c = 0; c < 3; ++c) {
    double sum = 0;
    for (size_t i = 0; i < n; ++i) {
      sum += static_cast<double>(tile.channel(high[c])[i]) +
             static_cast<double>(tile.channel(low[c])[i]);
    }
    const double mean = sum / weight;
    result.mean[c] = static_cast<float>(mean);
    double square_sum = 0;
    const uint32_t count = tile.replicate_count();
    for (uint32_t r = 0; r < count; ++r) {
      double replicate_sum = 0, replicate_weight = 0;
      for (size_t i = 0; i < n; ++i) {
        replicate_sum += static_cast<double>(tile.replicate(r, c)[i]);
        replicate_weight += static_cast<double>(tile.replicate(r, 3)[i]);
      }
      const double deviation = replicate_sum / replicate_weight - mean;
      square_sum += deviation * deviation;
    }
    if (count > 1) {
      result.standard_error[c] =
          static_cast<float>(std::sqrt(square_sum / (static_cast<double>(count) * (count - 1))));
    }
  }
  return result;
}

inline TileMean RenderMean(const SceneDescription& scene, const FrameSettings& settings) {
  const CompiledScenePtr compiled = Compile(scene, settings);
  RenderStats stats;
  TileMean mean = MeanOf(RenderAll(*compiled, &stats));
  mean.rays = stats.rays;
  return mean;
}

// Tests each channel against a known mean. The threshold is 5 standard errors: by Student's t with
// the 15 degrees of freedom of 16 replicates a correct mean fails with probability 1.6e-4 (and
// seeds are fixed). 4 float roundings are added for results without noise.
inline void ExpectMean(const TileMean& measured, Rgb expected) {
  EXPECT_EQ(measured.non_finite, 0u);
  for (size_t c = 0; c < 3; ++c) {
    const double allowed = 5 * static_cast<double>(measured.standard_error[c]) +
                           4 * 0x1p-23 * std::fabs(static_cast<double>(expected[c]));
    EXPECT_NEAR(measured.mean[c], expected[c], allowed) << "channel " << c;
  }
}

}  // namespace sheaf::render
