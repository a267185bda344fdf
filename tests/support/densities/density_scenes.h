// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Scenes for tests of the densities of paths: every kind of vertex and of light end.
#pragma once

#include <utility>
#include <variant>
#include <vector>

#include "tests/support/emissive_scenes.h"
#include "tests/support/lenses.h"
#include "tests/support/technique_scenes.h"

namespace sheaf::render {

struct DensityScene {
  const char* name;
  TestScene scene;
  bool is_specular = false;   // Many paths have specular vertices.
  bool has_media = false;     // Many paths have vertices in media.
  bool has_emission = false;  // Many paths begin in media.
};

inline void AddPointLight(TestScene* t, Vec3d from) {
  PointLight point;
  point.intensity.rgb = {2, 1, 1};
  point.from = from;
  t->scene.lights.push_back({point, {}, {}, {}});
}

// A ball of smooth glass and a mirror beside a lamp.
inline TestScene GlassAndMirror() {
  TestScene t = OpenBox({1});
  AddPointEmitter(&t, {1}, 0.9f);
  t.AddShape(kBall, t.AddMaterial(DielectricMaterial{}), TranslateMatrix({0.3, 0.8, 0}));
  ConductorMaterial mirror;
  mirror.has_reflectance = true;
  mirror.reflectance.value.rgb = Rgb::Gray(0.9f);
  t.AddShape(
      MeshShape{t.Quad({-1.9f, 0.1f, 1}, {-1.2f, 0.1f, 1.6f}, {-1.2f, 2, 1.6f}, {-1.9f, 2, 1})},
      t.AddMaterial(mirror));
  return t;
}

// Normals that differ from the true ones at a floor, and at a pane with one face: light is on one
// side of its glass, and the lens on the other.
inline TestScene TiltedNormals() {
  TestScene t = OpenBox({1});
  AddPointEmitter(&t, {1}, 0.9f);
  const auto tilted = [&t](int32_t mesh, Vec3f n) {
    t.scene.meshes[static_cast<size_t>(mesh)].normals.assign(4, Normalize(n));
    return MeshShape{mesh};
  };
  t.AddShape(tilted(t.Quad({-1.5f, 0.2f, -1.5f}, {-1.5f, 0.2f, 1.5f}, {1.5f, 0.2f, 1.5f},
                           {1.5f, 0.2f, -1.5f}),
                    {0.2f, 1, 0.1f}),
             t.Diffuse({0.6f, 0.5f, 0.4f}));
  t.AddShape(tilted(t.Quad({-1.5f, 1.4f, -1.5f}, {-1.5f, 1.4f, 1.5f}, {1.5f, 1.4f, 1.5f},
                           {1.5f, 1.4f, -1.5f}),
                    {-0.1f, 1, 0.15f}),
             t.AddMaterial(DielectricMaterial{}));
  return t;
}

// A lamp within a ball of smooth glass.
inline TestScene LampInGlass() {
  TestScene t = OpenBox({1});
  t.AddShape(SphereShape{0.2f, -0.2f, 0.2f, 360}, t.Diffuse({}), TranslateMatrix({0, 1.2, 0}))
      .area_light = t.AreaLight({6, 5, 4});
  t.AddShape(kBall, t.AddMaterial(DielectricMaterial{}), TranslateMatrix({0, 1.2, 0}));
  return t;
}

// Cameras other than pinholes and thin lenses.
inline std::vector<DensityScene> CameraScenes() {
  TestScene realistic = Glossy({1});
  CameraDescription& camera = realistic.scene.camera;
  camera.kind = CameraDescription::Kind::kRealistic;
  camera.lens = sheaf::testing::DoubleGauss();
  camera.lens.aperture_diameter_mm = 25;
  camera.lens.aperture = LensDescription::Aperture::kDisk;
  camera.lens.film_diagonal_mm = 40;
  camera.lens.focus_distance_m = 3;
  TestScene sphere = GlassAndMirror();
  sphere.scene.camera.kind = CameraDescription::Kind::kEqualArea;
  TestScene parallel = GlassAndMirror();
  parallel.scene.camera.kind = CameraDescription::Kind::kOrthographic;
  return {{"realistic lens", std::move(realistic)},
          {"spherical camera", std::move(sphere), true},
          {"orthographic camera", std::move(parallel), true}};
}

inline std::vector<DensityScene> SurfaceScenes() {
  TestScene lamp = Diffuse({1});
  AddPointLight(&lamp, {1, 1.4f, -0.5f});
  TestScene lens = Glossy({1});
  lens.scene.camera.lens_radius = 0.1f;
  lens.scene.camera.focal_distance = 3;
  return {{"lamps", std::move(lamp)},
          {"glossy bodies before a lens", std::move(lens)},
          {"room", LitRoom(1)},
          {"glass and mirror", GlassAndMirror(), true},
          {"tilted normals", TiltedNormals(), true},
          {"lamp in glass", LampInGlass(), true}};
}

inline std::vector<DensityScene> SkyScenes() {
  TestScene leaves = Outdoor({1});
  leaves.scene.camera.shutter_close = 0;
  for (ShapeDescription& shape : leaves.scene.shapes) {
    shape.world_from_object.end = shape.world_from_object.start;
  }
  TestScene glass = GlassAndMirror();
  glass.ConstantEnvironment({0.6f, 0.8f, 1});
  TestScene portal = Diffuse({1});
  portal.ConstantEnvironment({0.6f, 0.8f, 1});
  std::get<InfiniteLight>(portal.scene.lights.back().light).portal = {
      {-1, 2.5, -1}, {1, 2.5, -1}, {1, 2.5, 1}, {-1, 2.5, 1}};
  return {{"sky over leaves", std::move(leaves)},
          {"sky through glass", std::move(glass), true},
          {"sky through a portal", std::move(portal)}};
}

// Fog with lamps of every kind that a line may find, and with many.
inline std::vector<DensityScene> MediumScenes() {
  TestScene many = Foggy({1});
  for (int i = 0; i < 20; ++i) {
    AddPointLight(&many, {0.35 * (i % 5) - 0.7, 1.2 + 0.1 * (i % 3), 0.4 * (i / 5) - 0.6});
  }
  return {{"fog", Foggy({1}), false, true}, {"fog and many lamps", std::move(many), false, true}};
}

// Heterogeneous media, with lamps without size.
inline std::vector<DensityScene> CloudScenes() {
  TestScene t = Cloudy({1});
  for (ShapeDescription& shape : t.scene.shapes) shape.area_light = kNone;
  AddPointLight(&t, {0.2, 0.9, 0.1});
  return {{"clouds", std::move(t), false, true}};
}

// A mirror that the camera sees, in the plane x = kMirrorX, beside bodies and lamps.
inline constexpr double kMirrorX = 1.8;
inline std::vector<DensityScene> MirrorScenes() {
  std::vector<DensityScene> scenes{{"mirrored", Diffuse({1}), true},
                                   {"mirrored, glossy bodies", Glossy({1}), true}};
  ConductorMaterial mirror;
  mirror.has_reflectance = true;
  mirror.reflectance.value.rgb = Rgb::Gray(1);
  constexpr auto kX = static_cast<float>(kMirrorX);
  for (DensityScene& scene : scenes) {
    TestScene& t = scene.scene;
    t.AddShape(
        MeshShape{t.Quad({kX, 0.02f, -3}, {kX, 0.02f, 1.9f}, {kX, 2.9f, 1.9f}, {kX, 2.9f, -3})},
        t.AddMaterial(mirror));
  }
  return scenes;
}

inline std::vector<DensityScene> GasScenes() {
  return {{"gas", SmokelessRoom(), false, false, true}};
}
inline std::vector<DensityScene> FlameScenes() {
  return {{"flame", RoomWithFlame(), false, false, true}};
}

// Many lamps, near and far, which vertices split.
inline std::vector<DensityScene> SplitScenes() {
  TestScene points = Diffuse({1}), glass = GlassAndMirror();
  for (int i = 0; i < 20; ++i) {
    const double x = 0.35 * (i % 5) - 0.7, z = 0.4 * (i / 5) - 0.6;
    AddPointLight(&points, {x, 1.2 + 0.1 * (i % 3), z});
  }
  for (int i = 0; i < 6; ++i) {
    glass
        .AddShape(SphereShape{0.05f, -0.05f, 0.05f, 360}, glass.Diffuse({}),
                  TranslateMatrix({0.5 * i - 1.4, 2.2, 0.2 * i - 0.4}))
        .area_light = glass.AreaLight({6, 5, 4});
  }
  return {{"many lamps", std::move(points)}, {"lamps beside glass", std::move(glass), true}};
}

inline std::vector<DensityScene> GuidedScenes() {
  return {{"guided, glossy bodies", Glossy({1})},
          {"guided, glass and mirror", GlassAndMirror(), true}};
}

inline std::vector<DensityScene> SpectralScenes() {
  return {{"spectral, glossy bodies", Glossy({1})},
          {"spectral, glass and mirror", GlassAndMirror(), true}};
}

}  // namespace sheaf::render
