// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of cameras with clip planes, named as in the catalogue (L52): what is before the near
// plane and behind the far plane is not seen, but gives light, shadows and reflections.
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "common/math/transform.h"
#include "gtest/gtest.h"
#include "tests/support/hard_case.h"
#include "tests/support/test_scene.h"

namespace sheaf::render {
namespace {

constexpr float kFarthest = std::numeric_limits<float>::infinity();
constexpr float kSky = 0.25f;

// A camera at the origin that looks along z through 90 degrees, under a gray sky.
class ClippedScene : public TestScene {
 public:
  ClippedScene(float near_clip, float far_clip) : TestScene({0, 0, 0}, {0, 0, 1}, 90) {
    scene.camera.near_clip = near_clip;
    scene.camera.far_clip = far_clip;
    ConstantEnvironment(Rgb::Gray(kSky));
  }
  // A black wall across the view that shines towards the camera.
  ShapeDescription& AddWall(float z, float radiance) {
    const float w = 2 * std::fabs(z) + 10;
    ShapeDescription& wall =
        AddShape(MeshShape{z > 0 ? Quad({-w, -w, z}, {-w, w, z}, {w, w, z}, {w, -w, z})
                                 : Quad({-w, -w, z}, {w, -w, z}, {w, w, z}, {-w, w, z})},
                 Diffuse({}));
    wall.area_light = AreaLight(Rgb::Gray(radiance));
    return wall;
  }
  // A gray absorber in a box of interfaces.
  void AddSmoke(float sigma_a, float from_z, float to_z) {
    ShapeDescription& hull = AddShape(MeshShape{Box({-90, -90, from_z}, {90, 90, to_z})},
                                      AddMaterial(InterfaceMaterial{}));
    hull.media.inside = AddMedium(sigma_a);
  }
  int32_t AddMedium(float sigma_a) {
    MediumDescription smoke;
    smoke.name = "smoke " + std::to_string(scene.media.size());
    smoke.sigma_a.rgb = Rgb::Gray(sigma_a);
    smoke.sigma_s.rgb = {};
    scene.media.push_back(smoke);
    return static_cast<int32_t>(scene.media.size() - 1);
  }
};

void ExpectSeen(const TestScene& t, double expected, const std::string& figure,
                uint64_t samples = 1) {
  RenderStats stats;
  const CompiledScenePtr compiled = Compile(t.scene, SquareSettings(16, samples, 8));
  const TileMean mean = MeanOf(RenderAll(*compiled, &stats));
  EXPECT_EQ(stats.broken_nestings, 0u) << figure;
  ExpectHardCase({.row = "L52",
                  .figure = figure,
                  .expected = expected,
                  .measured = mean.mean.r,
                  .standard_error = mean.standard_error.r,
                  .tolerance = 2e-6});
}

// All of a wall at z is seen or not, though its corners are farther than its middle.
TEST(ClipPlanesStability, L52PlanesNotDistances) {
  struct Case {
    float near_clip, far_clip;
    double seen;
  };
  for (const auto kind :
       {CameraDescription::Kind::kPerspective, CameraDescription::Kind::kOrthographic}) {
    for (const Case& of :
         {Case{0, 5.001f, 2}, Case{4.999f, kFarthest, 2}, Case{5.001f, 11, 7},
          Case{0, 4.999f, kSky}, Case{5.001f, 9.999f, kSky}, Case{10.001f, kFarthest, kSky}}) {
      ClippedScene t(of.near_clip, of.far_clip);
      t.scene.camera.kind = kind;
      t.AddWall(5, 2);
      t.AddWall(10, 7);
      ExpectSeen(t, of.seen,
                 (kind == CameraDescription::Kind::kPerspective ? "perspective, from "
                                                                : "orthographic, from ") +
                     InWords(of.near_clip) + " to " + InWords(of.far_clip));
    }
  }
}

// The camera's ray keeps its rest behind half transparent walls.
TEST(ClipPlanesStability, L52CutOuts) {
  for (const float far_clip : {4.999f, 5.001f}) {
    ClippedScene t(1, far_clip);
    for (const float z : {0.5f, 2.0f, 3.0f}) {
      ShapeDescription& wall = t.AddWall(z, 2);
      wall.has_alpha = true;
      wall.alpha.value = 0.5f;
    }
    t.AddWall(5, 7);
    const double behind = far_clip > 5 ? 7 : static_cast<double>(kSky);
    ExpectSeen(t, 0.75 * 2 + 0.25 * behind, "cut-outs, to " + InWords(far_clip), 256);
  }
}

// A narrow view: the lengths of all rays are 1 % alike.
TEST(ClipPlanesStability, L52Media) {
  const auto in_fog = [](float near_clip, float far_clip) {
    ClippedScene t(near_clip, far_clip);
    t.scene.camera.fov_degrees = 0.01f;
    t.scene.camera.medium = t.AddMedium(0.3f);
    return t;
  };
  ExpectSeen(in_fog(1, 4), kSky * std::exp(-0.3 * 3), "fog around the camera");
  ClippedScene wall = in_fog(1, 4);
  wall.AddWall(3, 2).media = {wall.scene.camera.medium, wall.scene.camera.medium};
  ExpectSeen(wall, 2 * std::exp(-0.3 * 2), "a wall in fog");
  struct Case {
    float near_clip, far_clip;
    double length;
  };
  for (const Case& of : {Case{0, 4, 2}, Case{3, 4, 1}, Case{3, kFarthest, 3}, Case{7, kFarthest, 0},
                         Case{1, 1.5f, 0}, Case{0, 8, 4}}) {
    ClippedScene t(of.near_clip, of.far_clip);
    t.scene.camera.fov_degrees = 0.01f;
    t.AddSmoke(0.5f, 2, 6);
    ExpectSeen(
        t, kSky * std::exp(-0.5 * of.length),
        "smoke between 2 and 6, from " + InWords(of.near_clip) + " to " + InWords(of.far_clip));
  }
}

// A camera whose near plane is inside a body of glass sees from within.
TEST(ClipPlanesStability, L52BodyCutOpen) {
  ClippedScene t(3, kFarthest);
  t.scene.camera.fov_degrees = 0.01f;
  DielectricMaterial glass;
  glass.eta.mean = 1.5f;
  ShapeDescription& body =
      t.AddShape(MeshShape{t.Box({-90, -90, 2}, {90, 90, 6})}, t.AddMaterial(glass));
  body.media.inside = t.AddMedium(0.5f);
  t.AddWall(8, 2);
  // A face reflects 4 %; what the back face sends back leaves through the front face, or meets it
  // again: the sky lies before, the wall behind. Radiance within is eta^2 times that outside.
  const double reflected = 0.04, crossed = std::exp(-0.5 * 4), first = std::exp(-0.5 * 3);
  const double loop = 1 / (1 - reflected * reflected * crossed * crossed);
  const double crosses = (1 - reflected) * 1.5 * 1.5;
  const double wall = crosses * 2, sky = crosses * static_cast<double>(kSky);
  ExpectSeen(t, first * loop * (wall + reflected * crossed * sky), "glass that is cut open", 1024);
}

// Scattered rays see what the camera does not.
TEST(ClipPlanesStability, L52OnlyTheCameraIsClipped) {
  ClippedScene t(2, 4);
  t.scene.camera.fov_degrees = 0.01f;
  ConductorMaterial mirror;
  mirror.has_reflectance = true;
  mirror.reflectance.value.rgb = Rgb::Gray(0.8f);
  mirror.roughness.u.value = mirror.roughness.v.value = 0;
  t.AddShape(MeshShape{t.Quad({-9, -9, 3}, {-9, 9, 3}, {9, 9, 3}, {9, -9, 3})},
             t.AddMaterial(mirror));
  t.AddWall(-10, 7);
  ExpectSeen(t, 0.8 * 7, "a wall behind the camera in a mirror");
  ClippedScene floor(0, 4);
  floor.scene.camera.fov_degrees = 0.01f;
  floor.AddShape(MeshShape{floor.Quad({-9, -9, 3}, {-9, 9, 3}, {9, 9, 3}, {9, -9, 3})},
                 floor.Diffuse(Rgb::Gray(0.5f)));
  floor.scene.lights.clear();
  PointLight lamp;
  lamp.intensity.rgb = Rgb::Gray(90);
  lamp.from = {0, 0, -10};
  floor.scene.lights.push_back({lamp, {}, {}, {}});
  ExpectSeen(floor, 0.5 / std::numbers::pi * 90 / (13.0 * 13.0),
             "a floor under a lamp behind the camera");
}

// A far plane beyond everything leaves each bit.
TEST(ClipPlanesStability, L52NothingIsCut) {
  TestScene t = LitRoom(1);
  FrameSettings settings = SquareSettings(16, 4, 4);
  settings.force_generic_variant = true;
  const FilmTile without = RenderAll(*Compile(t.scene, settings));
  t.scene.camera.far_clip = 1e6f;
  const FilmTile with = RenderAll(*Compile(t.scene, settings));
  for (const FilmChannel channel :
       {FilmChannel::kRedHi, FilmChannel::kGreenHi, FilmChannel::kBlueLo}) {
    for (size_t i = 0; i < with.plane_size(); ++i) {
      ASSERT_EQ(with.channel(channel)[i], without.channel(channel)[i]) << i;
    }
  }
}

}  // namespace
}  // namespace sheaf::render
