// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// G12, the assignment of media to the sides of a surface: the second name of a MediumInterface
// applies to the side of the normal, the first to the side behind it. Tests both windings and both
// orders of the names against Beer and Lambert's law. If the names of surfaces contradict each
// other, pbrt-v4's rule applies: a ray is in the medium that the surface it leaves specifies for
// that side.
#include <cmath>
#include <utility>
#include <vector>

#include "common/math/elementary.h"
#include "gtest/gtest.h"
#include "tests/support/fog_scene.h"
#include "tests/support/interior_scene.h"
#include "tests/support/long_tests.h"
#include "worker/render/medium/medium_set.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {
namespace {

constexpr Rgb kSigma{0.1f, 0.3f, 0.7f};

// How a file places fog on one side of a closed surface.
struct Written {
  bool normals_inward = false;
  bool fog_within = false;  // Otherwise around it.
  bool camera_in_fog = false;

  MediumBoundary NamesOf(int32_t fog) const {
    const int32_t within = fog_within ? fog : kNone, around = fog_within ? kNone : fog;
    return normals_inward ? MediumBoundary{around, within} : MediumBoundary{within, around};
  }
  // A surface without an outside name adds the inner medium to the surrounding one: docs/adr/0018.
  // Then it contradicts no path that comes from the front in fog.
  bool AddsUp(bool from_within) const {
    const bool names_outside = normals_inward == fog_within;
    return camera_in_fog && !names_outside && from_within == normals_inward;
  }
  bool Contradicts(bool from_within) const {
    const bool fog_there = from_within == fog_within;
    return camera_in_fog != fog_there && !AddsUp(from_within);
  }
};

template <typename Function>
void ForAllWritings(const Function& function) {
  for (const bool inward : {false, true}) {
    for (const bool within : {false, true}) {
      for (const bool camera_in_fog : {false, true}) {
        SCOPED_TRACE(::testing::Message() << "normals " << (inward ? "inward" : "outward")
                                          << ", fog " << (within ? "within" : "around")
                                          << ", camera in " << (camera_in_fog ? "fog" : "vacuum"));
        function(Written{inward, within, camera_in_fog});
      }
    }
  }
}

// Lengths of a path through a body: before, inside and behind it.
struct Way {
  double before, within, behind;
};
double FogOn(const Way& way, const Written& written) {
  const double adds = written.AddsUp(false) ? 1 : 0;
  return (written.camera_in_fog ? way.before : 0) +
         way.within * (adds + (written.fog_within ? 1 : 0)) +
         way.behind * (adds + (written.fog_within ? 0 : 1));
}
Rgb Dimmed(Rgb light, double length) {
  for (size_t c = 0; c < 3; ++c) {
    light[c] *= static_cast<float>(std::exp(-static_cast<double>(kSigma[c]) * length));
  }
  return light;
}
// Tolerance for images without noise but with float lengths.
void ExpectClose(const TileMean& measured, Rgb expected) {
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(measured.mean[c], expected[c], 2e-5 * static_cast<double>(expected[c])) << c;
  }
}

// Bodies from -1 to 1.
enum class Body { kBox, kMirroredBox, kBoxWithNormals, kSphere, kPlacedBox, kMirroredPlacedBox };

class SidesScene : public FogScene {
 public:
  SidesScene(const Written& written, Vec3d eye, Vec3d at, float fov_degrees = 1e-4f)
      : FogScene(eye, at, fov_degrees), written_(written), fog_(AddMedium(kSigma, {})) {
    if (written.camera_in_fog) scene.camera.medium = fog_;
  }
  void AddBody(Body body, int32_t material) {
    const bool is_placed = body == Body::kPlacedBox || body == Body::kMirroredPlacedBox;
    const bool mirrors = body == Body::kMirroredBox || body == Body::kMirroredPlacedBox;
    const Matrix4 place = ScaleMatrix({mirrors ? -1.0 : 1.0, 1, 1});
    if (body == Body::kSphere) {
      Finish(AddShape(SphereShape{1, -1, 1, 360}, material));
      return;
    }
    const int32_t box = Box({-1, -1, -1}, {1, 1, 1});
    if (body == Body::kBoxWithNormals) LetNormalsDecide(&scene.meshes[static_cast<size_t>(box)]);
    if (!is_placed) {
      Finish(AddShape(MeshShape{box}, material, place));
      return;
    }
    Finish(AddLooseShape(MeshShape{box}, material));
    scene.objects.push_back({"body", {static_cast<int32_t>(scene.shapes.size() - 1)}, {}});
    scene.instances.push_back({0, {place, place}, {}});
  }
  // Gives the shape its orientation and media as written in the file.
  ShapeDescription& Finish(ShapeDescription& shape) {
    shape.reverse_orientation = written_.normals_inward;
    shape.media = written_.NamesOf(fog_);
    shape.location = {0, 7, 3};
    return shape;
  }
  // The light emits towards -z.
  void AddPointEmitter(float z) {
    const int32_t light = AreaLight(Rgb::Gray(1));
    AddShape(MeshShape{Quad({-9, -9, z}, {-9, 9, z}, {9, 9, z}, {9, -9, z})}, Diffuse({}))
        .area_light = light;
  }
  void AddPointLight(Vec3d from) {
    PointLight point_light;
    point_light.intensity.rgb = Rgb::Gray(1);
    point_light.from = from;
    scene.lights.push_back({point_light, {}, {}, {}});
  }

 private:
  // Vertex normals point outwards, and the winding contradicts them.
  static void LetNormalsDecide(TriangleMesh* mesh) {
    mesh->normals = mesh->positions;
    for (size_t i = 0; i + 2 < mesh->indices.size(); i += 3) {
      std::swap(mesh->indices[i], mesh->indices[i + 1]);
    }
  }

  Written written_;
  int32_t fog_;
};

// A light behind a body, seen through it.
TEST(MediumSideStability, G12FogIsOnTheNamedSide) {
  for (const Body body : {Body::kBox, Body::kMirroredBox, Body::kBoxWithNormals, Body::kSphere,
                          Body::kPlacedBox, Body::kMirroredPlacedBox}) {
    SCOPED_TRACE(static_cast<int>(body));
    ForAllWritings([&](const Written& written) {
      // Away from the diagonals of the box's faces.
      const double aside = body == Body::kSphere ? 0 : 0.1;
      SidesScene t(written, {aside, 2 * aside, -4}, {aside, 2 * aside, 0});
      t.AddBody(body, t.AddMaterial(InterfaceMaterial{}));
      t.AddPointEmitter(6);
      const Rendered rendered = RenderCounted(t.scene, SquareSettings(2, 16, 5));
      ExpectClose(rendered.mean, Dimmed(Rgb::Gray(1), FogOn({3, 2, 5}, written)));
      const bool contradicts = written.Contradicts(false);
      EXPECT_EQ(rendered.stats.broken_nestings, contradicts ? 64u : 0u);
      EXPECT_EQ(rendered.stats.broken_at, contradicts ? "test.pbrt:7:3" : "");
    });
  }
}

// Light that a floor receives from a point light through the body.
TEST(MediumSideStability, G12ShadowRaysUseTheNamedSides) {
  ForAllWritings([](const Written& written) {
    SidesScene t(written, {0.5, 2, -2.5}, {0.5, 2, -3});
    t.AddBody(Body::kBox, t.AddMaterial(InterfaceMaterial{}));
    t.AddShape(MeshShape{t.Quad({-9, -9, -3}, {9, -9, -3}, {9, 9, -3}, {-9, 9, -3})},
               t.Diffuse(Rgb::Gray(0.5f)));
    t.AddPointLight({-0.5, -2, 3});
    // A third of the path is inside. The camera is half a unit above the floor.
    const double way = std::sqrt(1.0 + 16 + 36);
    const auto lit = static_cast<float>(0.5 / kPi * (6 / way) / (way * way));
    const Rendered rendered = RenderCounted(t.scene, SquareSettings(2, 16, 2));
    ExpectClose(rendered.mean,
                Dimmed(Rgb::Gray(lit), FogOn({0.5 + way / 3, way / 3, way / 3}, written)));
  });
}

// A wall reflects light into the medium on its lit side. Fog inside is behind it.
TEST(MediumSideStability, G12ReflectedLightIsOnTheNamedSide) {
  ForAllWritings([](const Written& written) {
    SidesScene t(written, {0.1, 0, -2}, {0.1, 0, 0});
    t.Finish(t.AddShape(MeshShape{t.Quad({-9, -9, 0}, {-9, 9, 0}, {9, 9, 0}, {9, -9, 0})},
                        t.Diffuse(Rgb::Gray(0.5f))));
    t.AddPointLight({0.1, 0, -3});
    const auto lit = static_cast<float>(0.5 / kPi / 9);
    const bool fog_around = !written.fog_within || written.AddsUp(false);
    const Rendered rendered = RenderCounted(t.scene, SquareSettings(2, 16, 2));
    ExpectClose(rendered.mean,
                Dimmed(Rgb::Gray(lit), (written.camera_in_fog ? 2 : 0) + (fog_around ? 3.0 : 0.0)));
    EXPECT_EQ(rendered.stats.broken_nestings > 0, written.Contradicts(false));
  });
}

// The same with many reflections: a room with a light in its center. Chords between two points of a
// sphere have length 2 cos, with cosines as scattered by a diffuse wall.
TEST(MediumSideStability, G12WallsDefineTheRoomsMedium) {
  constexpr float kReflectance = 0.6f;
  ForAllWritings([](const Written& written) {
    SidesScene t(written, {0, 0, 0}, {0, 0, 1}, 40);
    t.Finish(t.AddShape(SphereShape{1, -1, 1, 360}, t.Diffuse(Rgb::Gray(kReflectance))));
    t.AddPointLight({0, 0, 0});
    const bool filled = written.fog_within || written.AddsUp(true);
    Rgb expected;
    for (size_t c = 0; c < 3; ++c) {
      const double a = 2 * static_cast<double>(kSigma[c]);
      const double left = filled ? 2 * (1 - std::exp(-a) * (1 + a)) / (a * a) : 1;
      const double fraction = static_cast<double>(kReflectance);
      expected[c] = static_cast<float>(fraction / kPi / (1 - fraction * left));
    }
    const Rendered rendered =
        RenderCounted(t.scene, SquareSettings(8, DrawCount(256, 4096), 1 << 20));
    ExpectMean(rendered.mean,
               Dimmed(expected, (filled ? 1.0 : 0.0) + (written.camera_in_fog ? 1.0 : 0.0)));
    EXPECT_EQ(rendered.stats.broken_nestings > 0, written.Contradicts(true));
  });
}

// Gems: glass filled with a medium. At normal incidence glass reflects alike from both sides, so a
// reversed winding transmits as much; light is reflected to and fro inside.
TEST(MediumSideStability, G12GemsHaveTheirColor) {
  ForAllWritings([](const Written& written) {
    if (written.camera_in_fog) return;
    SidesScene t(written, {0.1, 0.2, -4}, {0.1, 0.2, 0});
    DielectricMaterial glass;
    glass.eta.mean = 1.5f;
    t.AddBody(Body::kBox, t.AddMaterial(glass));
    t.AddPointEmitter(6);
    constexpr double kMirrored = 0.04;
    Rgb expected = Dimmed(Rgb::Gray(1), FogOn({3, 2, 5}, written));
    for (size_t c = 0; c < 3; ++c) {
      const double a = written.fog_within ? std::exp(-2 * static_cast<double>(kSigma[c])) : 1;
      expected[c] *= static_cast<float>((1 - kMirrored) * (1 - kMirrored) /
                                        (1 - kMirrored * kMirrored * a * a));
    }
    ExpectMean(RenderCounted(t.scene, SquareSettings(8, DrawCount(256, 4096), 64)).mean, expected);
  });
}

// A room full of scattering fog, with a block in it. For both windings, with matching names, the
// block is the same.
Rendered FoggedRoom(const Written& block) {
  FogScene t({0, 0, -0.9}, {-0.05, -0.4, 0}, 25);
  const int32_t fog = t.AddMedium(Rgb::Gray(0.01f), Rgb::Gray(2));
  t.scene.camera.medium = fog;
  const auto add = [&](int32_t mesh, int32_t material) -> ShapeDescription& {
    ShapeDescription& shape = t.AddShape(MeshShape{mesh}, material);
    shape.media.outside = fog;
    return shape;
  };
  add(t.Box({-1, -1, -1}, {1, 1, 1}), t.Diffuse({0.7f, 0.5f, 0.3f})).reverse_orientation = true;
  ShapeDescription& shape =
      add(t.Box({-0.4f, -0.9f, 0}, {0.3f, 0, 0.6f}), t.Diffuse(Rgb::Gray(0.6f)));
  shape.reverse_orientation = block.normals_inward;
  shape.media = block.NamesOf(fog);
  const int32_t light = t.AreaLight(Rgb::Gray(8));
  t.AddShape(MeshShape{t.Quad({-0.3f, 0.99f, -0.3f}, {0.3f, 0.99f, -0.3f}, {0.3f, 0.99f, 0.3f},
                              {-0.3f, 0.99f, 0.3f})},
             t.Diffuse({}))
      .area_light = light;
  return RenderCounted(t.scene, SquareSettings(8, DrawCount(128, 4096), 12));
}

TEST(MediumSideStability, G12WindingDoesNotMatterInFog) {
  const Rendered outward = FoggedRoom({false, false, true}),
                 inward = FoggedRoom({true, false, true});
  EXPECT_EQ(outward.stats.broken_nestings + inward.stats.broken_nestings, 0u);
  ExpectSameMean(outward.mean, inward.mean);
  // Faces that declare vacuum around them are reported.
  EXPECT_GT(FoggedRoom({true, true, true}).stats.broken_nestings, 1000u);
}

// For both windings of a closed shape, fog inside it is bounded, and fog around it is not.
TEST(MediumSideStability, G12EnclosedFogIsBounded) {
  for (const Body body : {Body::kBox, Body::kBoxWithNormals, Body::kSphere}) {
    ForAllWritings([&](const Written& written) {
      SidesScene t(written, {0, 0, -4}, {0, 0, 0});
      t.scene.camera.medium = kNone;
      t.AddBody(body, t.AddMaterial(InterfaceMaterial{}));
      const CompiledScenePtr compiled = Compile(t.scene, SquareSettings(2, 1, 1));
      MediumSet set;
      EXPECT_TRUE(set.Add(0));
      EXPECT_EQ(compiled->media->PropertiesOf<Rgb>(set, {}, MediumForm::kTrue).is_bounded,
                written.fog_within);
    });
  }
}

TEST(MediumSideStability, CrossingSidesUpdatesTheMedia) {
  constexpr uint16_t kBehind = 3, kBefore = 5, kOther = 7;
  struct Row {
    MediumSides sides;
    bool from_front, to_front;
    std::vector<uint16_t> before, after;
    Nesting nesting = Nesting::kRight;
  };
  const MediumSides both{kBehind, kBefore}, back{kBehind, {}}, front{{}, kBefore};
  constexpr Nesting kContradicted = Nesting::kContradicted;
  for (const Row& row : {
           Row{both, true, false, {kBefore, kOther}, {kBehind, kOther}},
           Row{both, false, true, {kBehind}, {kBefore}},
           Row{both, true, true, {kBefore}, {kBefore}},
           Row{both, true, false, {}, {kBehind}, kContradicted},
           Row{both, true, true, {kOther}, {kBefore}, kContradicted},
           Row{both, false, false, {kBefore}, {kBehind}, kContradicted},
           Row{back, true, false, {kBehind}, {kBehind, kBehind}},  // Adds to the surrounding one.
           Row{back, true, true, {kBehind, kOther}, {kBehind, kOther}},
           Row{back, false, true, {kBehind, kBehind}, {kBehind}},
           Row{back, false, true, {kOther}, {}, kContradicted},
           Row{front, false, true, {}, {kBefore}},
           Row{front, true, false, {kBefore, kOther}, {kOther}},
           Row{front, false, false, {kBefore}, {}, kContradicted},
           Row{front, false, true, {kBefore}, {kBefore}, kContradicted},
       }) {
    MediumSet set;
    for (const uint16_t medium : row.before) EXPECT_TRUE(set.Add(medium));
    EXPECT_EQ(CrossSides(row.sides, row.from_front, row.to_front, &set), row.nesting);
    EXPECT_EQ(std::vector<uint16_t>(set.begin(), set.end()), row.after);
  }
  MediumSet full;
  while (full.size() < kMediaAtOnceMax) EXPECT_TRUE(full.Add(kOther));
  EXPECT_EQ(CrossSides(back, true, false, &full), Nesting::kFull);
}

}  // namespace
}  // namespace sheaf::render
