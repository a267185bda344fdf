// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of shapes and lights that rays of some kinds do not see, named as in the catalogue
// (L44). Each technique that finds light has the same closed form.
#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <tuple>
#include <vector>

#include "common/math/transform.h"
#include "gtest/gtest.h"
#include "tests/support/hard_case.h"
#include "tests/support/test_scene.h"
#include "worker/render/integrator/path_integrator.h"

namespace sheaf::render {
namespace {

constexpr RayKinds kCamera = BitOf(RayKind::kCamera), kDiffuse = BitOf(RayKind::kDiffuse),
                   kGlossy = BitOf(RayKind::kGlossy), kTransmission = BitOf(RayKind::kTransmission),
                   kVolume = BitOf(RayKind::kVolume), kShadow = BitOf(RayKind::kShadow);
constexpr float kAlbedo = 0.5f;
constexpr uint64_t kFloorSamples = 64;

template <DirectLight kDirectLight>
TileMean MeanBy(const SceneDescription& scene, const FrameSettings& settings) {
  const CompiledScenePtr compiled = Compile(scene, settings);
  FilmTile tile(settings.window, {0, settings.samples});
  PixelAccumulator accumulator(&tile);
  RayCounts counts;
  PathIntegrator<kAllTraits, const EmbreeScene, kDirectLight> tracer(*compiled, *compiled->tracer,
                                                                     counts);
  for (int32_t y = 0; y < settings.height_px; ++y) {
    for (int32_t x = 0; x < settings.width_px; ++x) {
      accumulator.Begin(x, y);
      for (uint64_t s = 0; s < settings.samples; ++s) {
        accumulator.Add(s, tracer.TraceSample(x, y, s));
      }
      accumulator.End();
    }
  }
  return MeanOf(tile);
}

// The means by all techniques together, by light samples alone and by scattering alone.
std::vector<TileMean> MeansByTechnique(const SceneDescription& scene,
                                       const FrameSettings& settings) {
  return {RenderMean(scene, settings), MeanBy<DirectLight::kBySampling>(scene, settings),
          MeanBy<DirectLight::kByHitting>(scene, settings)};
}

// A point of a sheet at the origin, seen from its front or from behind, below the disk whose
// radius is its height, so that the fraction 1/2 of a cosine-weighted hemisphere meets it.
class DiskScene : public TestScene {
 public:
  explicit DiskScene(int32_t (*material)(TestScene*), bool from_behind = false)
      : TestScene({3, from_behind ? -0.5f : 0.5f, 0}, {0, 0, 0}, 0.01f) {
    AddShape(MeshShape{Quad({-4, 0, -4}, {-4, 0, 4}, {4, 0, 4}, {4, 0, -4})}, material(this));
  }
  static Matrix4 Place() { return TranslateMatrix({0, 1, 0}) * RotateMatrix(90, {1, 0, 0}); }
  ShapeDescription& AddDisk() { return AddShape(DiskShape{1, 0, 0, 360}, Diffuse({}), Place()); }
};

int32_t GrayFloor(TestScene* t) { return t->Diffuse(Rgb::Gray(kAlbedo)); }
int32_t GraySheet(TestScene* t) {
  DiffuseTransmissionMaterial sheet;
  sheet.transmittance.value.rgb = Rgb::Gray(kAlbedo);
  sheet.reflectance.value.rgb = {};
  return t->AddMaterial(sheet);
}

struct DiskCase {
  std::string name;
  RayKinds invisible;
  float emission;
};

// The disk hides half of a white sky where it casts shadows, and shines where it is seen.
double ExpectedUnderDisk(const DiskCase& of, RayKinds kind) {
  const double sky = (of.invisible & kShadow) != 0 ? 1 : 0.5;
  const double disk = (of.invisible & kind) != 0 ? 0 : 0.5 * static_cast<double>(of.emission);
  return static_cast<double>(kAlbedo) * (sky + disk);
}

void ExpectUnderDisks(int32_t (*material)(TestScene*), RayKinds kind, bool from_behind,
                      const std::string& sheet) {
  for (const DiskCase& of : {
           DiskCase{"all see it", 0, 0},
           {"no shadow", kShadow, 0},
           {"no scattered ray sees it", kind, 0},
           {"neither", static_cast<RayKinds>(kind | kShadow), 0},
           {"a lamp", 0, 3},
           {"a lamp without shadow", kShadow, 3},
           {"an unseen lamp with a shadow", kind, 3},
           {"no lamp", static_cast<RayKinds>(kind | kShadow), 3},
       }) {
    DiskScene t(material, from_behind);
    t.ConstantEnvironment(Rgb::Gray(1));
    ShapeDescription& disk = t.AddDisk();
    disk.invisible = of.invisible;
    if (of.emission > 0) disk.area_light = t.AreaLight(Rgb::Gray(of.emission));
    for (const TileMean& mean : MeansByTechnique(t.scene, SquareSettings(8, kFloorSamples, 2))) {
      ExpectHardCase({.row = "L44",
                      .figure = sheet + ": " + of.name,
                      .expected = ExpectedUnderDisk(of, kind),
                      .measured = mean.mean.r,
                      .standard_error = mean.standard_error.r,
                      .tolerance = 1e-6});
    }
  }
}

TEST(RayVisibilityStability, L44DiffuseRays) {
  ExpectUnderDisks(GrayFloor, kDiffuse, false, "a floor under a disk");
}

// Two skies, each of which some rays do not see.
TEST(RayVisibilityStability, L44SkiesOfTheirOwn) {
  DiskScene t(GrayFloor);
  t.ConstantEnvironment(Rgb::Gray(1));
  t.ConstantEnvironment(Rgb::Gray(4));
  for (const auto& [first, second, expected] :
       {std::tuple<RayKinds, RayKinds, double>{kDiffuse, kCamera, 4},
        {kCamera, kDiffuse, 1},
        {kGlossy, 0, 5},
        {kDiffuse, kDiffuse | kCamera, 0}}) {
    t.scene.lights[0].invisible = first;
    t.scene.lights[1].invisible = second;
    for (const TileMean& mean : MeansByTechnique(t.scene, SquareSettings(8, kFloorSamples, 2))) {
      ExpectHardCase({.row = "L44",
                      .figure = "a floor under two skies, of which it sees " + InWords(expected),
                      .expected = static_cast<double>(kAlbedo) * expected,
                      .measured = mean.mean.r,
                      .standard_error = mean.standard_error.r,
                      .tolerance = 1e-6});
    }
  }
  // The camera looks past the floor.
  t.SetCamera({3, 2, 0}, {3, 9, 0}, 1, {1, 0, 0});
  t.scene.lights[0].invisible = kCamera;
  t.scene.lights[1].invisible = kDiffuse;
  EXPECT_EQ(RenderMean(t.scene, SquareSettings(8, 1, 2)).mean, Rgb::Gray(4));
}

TEST(RayVisibilityStability, L44Transmission) {
  ExpectUnderDisks(GraySheet, kTransmission, true, "a sheet under a disk, from behind");
}

TEST(RayVisibilityStability, L44Spectral) {
  DiskScene t(GrayFloor);
  t.ConstantEnvironment(Rgb::Gray(1));
  t.AddDisk().invisible = kShadow;
  FrameSettings settings = SquareSettings(8, kFloorSamples, 2);
  settings.color = ColorTransport::kSpectral;
  const TileMean mean = RenderMean(t.scene, settings);
  EXPECT_NEAR(mean.mean.g, kAlbedo, 5 * mean.standard_error.g + 0.01f);
}

// Instances and shapes that move have the masks of their shapes.
TEST(RayVisibilityStability, L44InstancesAndMotion) {
  for (const bool moves : {false, true}) {
    for (const RayKinds invisible : {RayKinds{0}, kShadow}) {
      DiskScene t(GrayFloor);
      t.ConstantEnvironment(Rgb::Gray(1));
      if (moves) {
        t.scene.camera.shutter_close = 1;
        ShapeDescription& disk = t.AddDisk();
        disk.invisible = invisible;
        // Turned about its axis.
        disk.world_from_object.end = DiskScene::Place() * RotateMatrix(40, {0, 0, 1});
      } else {
        t.AddLooseShape(DiskShape{1, 0, 0, 360}, t.Diffuse({}), DiskScene::Place()).invisible =
            invisible;
        t.scene.objects.push_back({"disk", {static_cast<int32_t>(t.scene.shapes.size() - 1)}, {}});
        ObjectInstance instance;
        instance.object = 0;
        t.scene.instances.push_back(instance);
      }
      const TileMean mean = RenderMean(t.scene, SquareSettings(8, kFloorSamples, 2));
      ExpectHardCase({.row = "L44",
                      .figure = std::string(moves ? "a moving disk" : "an instance of a disk") +
                                (invisible == 0 ? "" : " without shadow"),
                      .expected = ExpectedUnderDisk({"", invisible, 0}, kDiffuse),
                      .measured = mean.mean.r,
                      .standard_error = mean.standard_error.r,
                      .tolerance = 1e-6});
    }
  }
}

int32_t RoughPrincipled(TestScene* t) {
  PrincipledMaterial material;
  material.base_color.value.rgb = {0.6f, 0.4f, 0.2f};
  material.sheen_color.value.rgb = Rgb::Gray(0.3f);
  material.coat.value = 0.5f;
  material.coat_roughness.value = 0.3f;
  return t->AddMaterial(material);
}
int32_t RoughCoat(TestScene* t) {
  CoatedDiffuseMaterial material;
  material.reflectance.value.rgb = {0.6f, 0.4f, 0.2f};
  material.roughness.u.value = material.roughness.v.value = 0.1f;
  return t->AddMaterial(material);
}

// A lamp that blocks no light; its light through diffuse and through glossy rays is all of it. A
// small lamp favors light samples, a large one scattering.
TEST(RayVisibilityStability, L44LobesSumToTheWhole) {
  for (int32_t (*const material)(TestScene*) : {RoughPrincipled, RoughCoat}) {
    for (const float radius : {0.02f, 0.6f}) {
      std::vector<std::vector<TileMean>> means;
      for (const RayKinds invisible : {kCamera, kGlossy, kDiffuse}) {
        TestScene t({3, 2, 0}, {0, 0, 0}, 0.01f);
        t.AddShape(MeshShape{t.Quad({-4, 0, -4}, {-4, 0, 4}, {4, 0, 4}, {4, 0, -4})}, material(&t));
        ShapeDescription& lamp =
            t.AddShape(SphereShape{radius, -radius, radius, 360},
                       t.AddMaterial(InterfaceMaterial{}), TranslateMatrix({-1.5, 1, 0}));
        lamp.invisible = invisible;
        lamp.area_light = t.AreaLight(Rgb::Gray(1 / (radius * radius)));
        means.push_back(MeansByTechnique(t.scene, SquareSettings(8, 1024, 1)));
      }
      for (size_t technique = 0; technique < means[0].size(); ++technique) {
        // Scattering alone does not find the small lamp.
        if (technique == 2 && radius < 0.1f) continue;
        const TileMean &whole = means[0][0], &diffuse = means[1][technique],
                       &glossy = means[2][technique];
        for (size_t c = 0; c < 3; ++c) {
          EXPECT_GT(diffuse.mean[c], 0.02f * whole.mean[c]);
          EXPECT_GT(glossy.mean[c], 0.02f * whole.mean[c]);
          ExpectHardCase(
              {.row = "L44",
               .figure = std::string("diffuse and glossy light of a lamp of ") + InWords(radius) +
                         ", color " + std::to_string(c),
               .expected = whole.mean[c],
               .measured = diffuse.mean[c] + glossy.mean[c],
               .standard_error = std::hypot(whole.standard_error[c], diffuse.standard_error[c],
                                            glossy.standard_error[c]),
               .tolerance = 1e-4f * whole.mean[c]});
        }
      }
    }
  }
}

// Camera rays see what is behind, and so does a mirror.
TEST(RayVisibilityStability, L44CameraAndMirror) {
  const auto render = [](bool has_mirror, bool has_lamp, RayKinds invisible) {
    TestScene t({3, 2, 0}, {0, 0, 0}, 1);
    t.ConstantEnvironment({0.25f, 0.5f, 1});
    if (has_mirror) {
      ConductorMaterial mirror;
      mirror.has_reflectance = true;
      mirror.reflectance.value.rgb = Rgb::Gray(0.8f);
      mirror.roughness.u.value = mirror.roughness.v.value = 0;
      t.AddShape(MeshShape{t.Quad({-4, 0, -4}, {-4, 0, 4}, {4, 0, 4}, {4, 0, -4})},
                 t.AddMaterial(mirror));
    }
    if (has_lamp) {
      const Vec3d place = has_mirror ? Vec3d{-3, 2, 0} : Vec3d{1.5, 1, 0};
      ShapeDescription& lamp =
          t.AddShape(SphereShape{0.5f, -0.5f, 0.5f, 360}, t.Diffuse({}), TranslateMatrix(place));
      lamp.invisible = invisible;
      lamp.area_light = t.AreaLight(Rgb::Gray(9));
    }
    return RenderMean(t.scene, SquareSettings(8, 16, 3)).mean;
  };
  for (const bool has_mirror : {false, true}) {
    const Rgb without = render(has_mirror, false, 0);
    EXPECT_EQ(render(has_mirror, true, has_mirror ? kGlossy : kCamera), without);
    EXPECT_GT(render(has_mirror, true, has_mirror ? kCamera : kGlossy).b, 3 * without.b);
  }
}

// In fog that loses no light, a black lamp that neither scattered nor shadow rays see.
TEST(RayVisibilityStability, L44Volume) {
  for (const RayKinds invisible : {kVolume, kShadow}) {
    TestScene t({0, 0, -4}, {0, 0, 0}, 20);
    t.ConstantEnvironment(Rgb::Gray(1));
    MediumDescription fog;
    fog.name = "fog";
    fog.sigma_s.rgb = Rgb::Gray(1.5f);
    fog.sigma_a.rgb = {};
    t.scene.media.push_back(fog);
    ShapeDescription& hull =
        t.AddShape(SphereShape{1, -1, 1, 360}, t.AddMaterial(InterfaceMaterial{}));
    hull.media.inside = 0;
    ShapeDescription& lamp = t.AddShape(SphereShape{0.3f, -0.3f, 0.3f, 360}, t.Diffuse({}));
    lamp.media.inside = lamp.media.outside = 0;
    lamp.invisible = kCamera | kVolume | kShadow;
    lamp.area_light = t.AreaLight(Rgb::Gray(5));
    // Without shadows alone: what volume rays see of it is dark, and the sky behind it bright.
    if (invisible == kShadow) {
      lamp.area_light = kNone;
      lamp.invisible = kCamera | kShadow;
    }
    const int32_t max_depth = invisible == kShadow ? 1 : 200;
    const std::vector<TileMean> means =
        MeansByTechnique(t.scene, SquareSettings(8, 256, max_depth));
    TestScene empty = t;
    empty.scene.world_shapes.pop_back();
    const TileMean without = RenderMean(empty.scene, SquareSettings(8, 256, max_depth));
    for (const TileMean& mean : means) {
      ExpectHardCase({.row = "L44",
                      .figure = invisible == kShadow ? "fog about a black ball without shadow"
                                                     : "fog about an unseen lamp",
                      .expected = without.mean.r,
                      .measured = mean.mean.r,
                      .standard_error = std::hypot(mean.standard_error.r, without.standard_error.r),
                      .tolerance = 1e-4});
    }
  }
}

// Each ray meets the face that it sees, if two are at one place.
TEST(RayVisibilityStability, L44FacesAtOnePlace) {
  for (const bool unseen_first : {false, true}) {
    TestScene t({3, 2, 0}, {0, 0, 0}, 0.01f);
    t.ConstantEnvironment(Rgb::Gray(1));
    const int32_t red = t.Diffuse({0.5f, 0, 0}), green = t.Diffuse({0, 0.5f, 0});
    for (const bool is_unseen : {unseen_first, !unseen_first}) {
      t.AddShape(MeshShape{t.Quad({-4, 0, -4}, {-4, 0, 4}, {4, 0, 4}, {4, 0, -4})},
                 is_unseen ? red : green)
          .invisible = is_unseen ? kCamera : RayKinds{0};
    }
    ExpectMean(RenderMean(t.scene, SquareSettings(8, 64, 3)), {0, 0.5f, 0});
  }
}

// Smoke and glass that some rays do not see are neither entered nor left by them.
TEST(RayVisibilityStability, L44BodiesAreLeftByWhoEntered) {
  const auto expect_mean = [](const TestScene& t, double expected, double tolerance,
                              const std::string& figure) {
    RenderStats stats;
    const CompiledScenePtr compiled = Compile(t.scene, SquareSettings(16, 64, 1000));
    const TileMean mean = MeanOf(RenderAll(*compiled, &stats));
    EXPECT_EQ(stats.broken_nestings, 0u) << figure;
    ExpectHardCase({.row = "L44",
                    .figure = figure,
                    .expected = expected,
                    .measured = mean.mean.r,
                    .standard_error = mean.standard_error.r,
                    .tolerance = tolerance});
  };
  {
    TestScene t({3, 0.5, 0}, {0, 0, 0}, 0.01f);
    t.AddShape(MeshShape{t.Quad({-4, 0, -4}, {-4, 0, 4}, {4, 0, 4}, {4, 0, -4})}, GrayFloor(&t));
    PointLight light;
    light.intensity.rgb = Rgb::Gray(9);
    light.from = {0, 3, 0};
    t.scene.lights.push_back({light, {}, {}, {}});
    MediumDescription smoke;
    smoke.name = "smoke";
    smoke.sigma_a.rgb = Rgb::Gray(2);
    smoke.sigma_s.rgb = {};
    t.scene.media.push_back(smoke);
    ShapeDescription& hull =
        t.AddShape(MeshShape{t.Box({-1, -1, -1}, {1, 1, 1})}, t.AddMaterial(InterfaceMaterial{}));
    hull.media.inside = 0;
    hull.invisible = kCamera | kShadow;
    expect_mean(t, static_cast<double>(kAlbedo) / std::numbers::pi, 1e-5,
                "a floor in unseen smoke");
  }
  for (const RayKinds of_box : {RayKinds{0}, kCamera, kTransmission, kGlossy, kShadow}) {
    for (const RayKinds of_ball : {RayKinds{0}, kCamera, kTransmission, kGlossy}) {
      TestScene t({0, 0.4, -4}, {0, 0, 0}, 25);
      t.ConstantEnvironment(Rgb::Gray(1));
      DielectricMaterial glass;
      glass.roughness.u.value = glass.roughness.v.value = 0;
      for (const int32_t priority : {1, 2}) {
        glass.eta.mean = 1.2f + 0.2f * static_cast<float>(priority);
        const int32_t material = t.AddMaterial(glass);
        t.scene.materials[static_cast<size_t>(material)].priority = priority;
        if (priority == 1) {
          t.AddShape(MeshShape{t.Box({-1, -1, -1}, {1, 1, 1})}, material).invisible = of_box;
        } else {
          t.AddShape(SphereShape{0.6f, -0.6f, 0.6f, 360}, material, TranslateMatrix({0.7, 0, 0}))
              .invisible = of_ball;
        }
      }
      // Light that a half visible ball lets into the box may never leave it.
      const bool is_reversible = of_ball == 0 || of_ball == kCamera;
      expect_mean(t, 1, is_reversible ? 0.001 : 0.01,
                  is_reversible ? "glass in glass under a white sky"
                                : "glass that some rays do not see in glass");
    }
  }
}

// Lights without a shape.
TEST(RayVisibilityStability, L44LightsWithoutShape) {
  const auto render = [](RayKinds of_sky, RayKinds of_point, bool sees_floor) {
    TestScene t({3, sees_floor ? 0.5f : 2.0f, 0}, {0, sees_floor ? 0.0f : 5.0f, 0}, 0.01f);
    t.AddShape(MeshShape{t.Quad({-4, 0, -4}, {-4, 0, 4}, {4, 0, 4}, {4, 0, -4})}, GrayFloor(&t));
    t.ConstantEnvironment(Rgb::Gray(1));
    t.scene.lights.back().invisible = of_sky;
    PointLight light;
    light.intensity.rgb = Rgb::Gray(static_cast<float>(std::numbers::pi));
    light.from = {0, 1, 0};
    t.scene.lights.push_back({light, {}, {}, {}});
    t.scene.lights.back().invisible = of_point;
    return RenderMean(t.scene, SquareSettings(8, 64, 3));
  };
  const auto expect = [](const TileMean& mean, float value) {
    EXPECT_NEAR(mean.mean.g, value, 5 * mean.standard_error.g + 2e-6f);
  };
  expect(render(kCamera, 0, false), 0);
  expect(render(kGlossy, 0, false), 1);
  expect(render(kCamera, kGlossy, true), 1);
  expect(render(kCamera, kDiffuse, true), 0.5f);
  expect(render(kDiffuse, kGlossy, true), 0.5f);
}

// The frames of scenes that hide nothing are those of the variants without.
TEST(RayVisibilityStability, L44NothingHidden) {
  TestScene t = LitRoom(1);
  FrameSettings settings = SquareSettings(16, 16, 4);
  settings.force_generic_variant = true;
  const TileMean plain = RenderMean(t.scene, settings);
  t.scene.shapes[1].invisible = kVolume;  // There is none.
  const TileMean hidden = RenderMean(t.scene, settings);
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(hidden.mean[c], plain.mean[c],
                5 * std::hypot(hidden.standard_error[c], plain.standard_error[c]));
  }
}

}  // namespace
}  // namespace sheaf::render
