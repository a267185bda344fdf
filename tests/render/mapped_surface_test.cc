// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Textures that perturb normals or emit light: rendered scenes with known results.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "tests/render/lossless_materials.h"
#include "tests/support/light_tables.h"
#include "tests/support/temporary_path.h"
#include "tests/support/test_scene.h"
#include "worker/render/bsdf/bsdf_sampling.h"
#include "worker/render/densities/weights.h"
#include "worker/render/geometry/surface_point.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {
namespace {

using testing::Estimate;
using testing::EstimateMean;

class MappedSurfaceTest : public ::testing::Test {
 protected:
  void SetUp() override {
    directory_ = sheaf::testing::TemporaryPath("maps");
    std::filesystem::create_directories(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  void Write(int size, const std::vector<Rgb>& texels) {
    testing::WritePfm((directory_ / "map.pfm").string(), size, texels);
  }
  CompiledScenePtr CompileMapped(const SceneDescription& scene, const FrameSettings& settings) {
    TableFileSource files({{"map.pfm", (directory_ / "map.pfm").string()}});
    CompileLimits limits;
    limits.build_threads = 1;
    absl::StatusOr<CompiledScenePtr> compiled = CompileScene(scene, settings, files, limits);
    EXPECT_TRUE(compiled.ok()) << compiled.status();
    return compiled.ok() ? *std::move(compiled) : nullptr;
  }
  TileMean RenderMapped(const SceneDescription& scene, const FrameSettings& settings) {
    return MeanOf(RenderAll(*CompileMapped(scene, settings)));
  }

  std::filesystem::path directory_;
};

// Makes map.pfm the normal map of every material so far.
void MapNormals(TestScene* t) {
  TextureDescription texture;
  texture.name = "normal map";
  texture.is_color = true;
  ImageTexture image;
  image.file = "map.pfm";
  texture.texture = image;
  t->scene.textures.push_back(texture);
  for (MaterialDescription& material : t->scene.materials) {
    if (std::holds_alternative<MixMaterial>(material.material)) continue;
    material.normal_map = static_cast<int32_t>(t->scene.textures.size() - 1);
  }
}

// Strongly perturbed normals, each in another direction.
const std::vector<Rgb> kStrongNormals = {
    {0.95f, 0.5f, 0.6f}, {0.1f, 0.2f, 0.7f}, {0.5f, 0.02f, 0.55f}, {0.6f, 0.9f, 0.4f}};

// Energy conservation: no light is lost to directions below the surface, and none is created.
TEST_F(MappedSurfaceTest, LosslessSurfacesVanishWithAnyNormals) {
  Write(2, kStrongNormals);
  // Smooth glass is excluded: mirrors with perturbed normals can trap light in total reflection
  // forever. tests/stability/shading_normal_stability_test.cc tests that each of its reflections
  // keeps all light.
  for (const testing::NamedMaterial& material : testing::LosslessMaterials()) {
    for (const ColorTransport color : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
      SCOPED_TRACE(material.name);
      TestScene t({0, 0, -4}, {0, 0, 0}, 40);
      t.ConstantEnvironment(Rgb::Gray(1));
      t.AddShape(SphereShape{1, -1, 1, 360}, material.add(t));
      MapNormals(&t);
      FrameSettings settings = SquareSettings(12, 64, 1000);
      settings.color = color;
      const TileMean mean = RenderMapped(t.scene, settings);
      EXPECT_EQ(mean.non_finite, 0u);
      EXPECT_NEAR(mean.mean.g, 1, 5 * static_cast<double>(mean.standard_error.g) + 0.005);
    }
  }
}

TestScene LitBall() {
  TestScene t({0, 0, -4}, {0, 0, 0}, 40);
  DistantLight sun;
  sun.radiance.rgb = Rgb::Gray(2);
  sun.from = {1, 1, -2};
  t.scene.lights.push_back({sun, {}, {}, {}});
  CoatedDiffuseMaterial coat;
  coat.roughness = {{0.3f, kNone}, {0.3f, kNone}, true};
  coat.reflectance.value.rgb = {0.3f, 0.2f, 0.1f};
  t.AddShape(SphereShape{1, -1, 1, 360}, t.AddMaterial(coat));
  return t;
}

TEST_F(MappedSurfaceTest, FlatNormalMapsHaveNoEffect) {
  Write(1, {{0.5f, 0.5f, 1}});
  TestScene t = LitBall();
  const TileMean plain = RenderMapped(t.scene, SquareSettings(16, 64, 3));
  MapNormals(&t);
  const CompiledScenePtr scene = CompileMapped(t.scene, SquareSettings(16, 64, 3));
  EXPECT_TRUE(Has(PlanOf(*scene).traits, Trait::kNormalMaps));
  const TileMean mapped = MeanOf(RenderAll(*scene));
  for (size_t c = 0; c < 3; ++c) {
    // The random numbers are the same relative to other tangents, which does not affect the samples
    // of a point light.
    EXPECT_NEAR(mapped.mean[c], plain.mean[c], 1e-5);
  }
}

// A map of twice the slopes is the map with a scale of 2.
TEST_F(MappedSurfaceTest, TheScaleOfANormalMapMultipliesItsSlopes) {
  const auto texel = [](float x, float y, float z) {
    const float length = std::sqrt(x * x + y * y + z * z);
    return Rgb{0.5f + 0.5f * x / length, 0.5f + 0.5f * y / length, 0.5f + 0.5f * z / length};
  };
  const auto render = [&](float slope, float scale) {
    Write(1, {texel(0.6f * slope, -0.3f * slope, 1)});
    TestScene t = LitBall();
    MapNormals(&t);
    t.scene.materials.back().normal_scale = scale;
    return RenderMapped(t.scene, SquareSettings(16, 64, 3));
  };
  const TileMean once = render(1, 1), twice = render(2, 1), scaled = render(1, 2);
  for (size_t c = 0; c < 3; ++c) {
    const float change = std::fabs(once.mean[c] - twice.mean[c]);
    EXPECT_GT(change, 2e-4f);
    EXPECT_NEAR(scaled.mean[c], twice.mean[c], 0.02 * static_cast<double>(change));
  }
}

// A square that fills the image and is lit evenly shows the mean of its colors times its texture.
TEST_F(MappedSurfaceTest, ColorsOfVerticesMultiplyTheTexture) {
  Write(1, {{0.8f, 0.5f, 0.25f}});
  const std::vector<VertexColor> colors = {
      {1, 0, 0, 1}, {0.2f, 0.6f, 1, 1}, {0, 1, 0.5f, 1}, {0.9f, 0.9f, 0.1f, 1}};
  for (const ColorTransport transport : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
    TestScene t({0, 0, -3}, {0, 0, 0}, 2);
    t.ConstantEnvironment(Rgb::Gray(1));
    ImageTexture image;
    image.file = "map.pfm";
    VertexColorTexture times;
    times.color.texture = 0;
    for (const auto& texture : {decltype(TextureDescription::texture){image}, {times}}) {
      TextureDescription description;
      description.is_color = true;
      description.texture = texture;
      t.scene.textures.push_back(description);
    }
    DiffuseMaterial diffuse;
    diffuse.reflectance.texture = 1;
    const float half = 3 * std::tan(static_cast<float>(std::numbers::pi) / 180);
    const int32_t mesh =
        t.Quad({-half, -half, 0}, {-half, half, 0}, {half, half, 0}, {half, -half, 0});
    t.scene.meshes[static_cast<size_t>(mesh)].colors = colors;
    t.AddShape(MeshShape{mesh}, t.AddMaterial(diffuse));
    FrameSettings settings = SquareSettings(8, 64, 2);
    settings.color = transport;
    const TileMean mean = RenderMapped(t.scene, settings);
    const Rgb texture{0.8f, 0.5f, 0.25f};
    for (size_t c = 0; c < 3; ++c) {
      const float sum = 2 * colors[0][c] + colors[1][c] + 2 * colors[2][c] + colors[3][c];
      EXPECT_NEAR(mean.mean[c], texture[c] * sum / 6,
                  5 * static_cast<double>(mean.standard_error[c]) + 0.004)
          << c;
    }
  }
}

// Alpha of vertices cuts out: half of the surrounding is seen through.
TEST_F(MappedSurfaceTest, AlphaOfVerticesIsOpacity) {
  TestScene t({0, 0, -3}, {0, 0, 0}, 2);
  t.ConstantEnvironment(Rgb::Gray(1));
  TextureDescription description;
  description.texture = VertexColorTexture{.value = {.value = 0.8f}};
  t.scene.textures.push_back(description);
  const int32_t mesh = t.Quad({-1, -1, 0}, {-1, 1, 0}, {1, 1, 0}, {1, -1, 0});
  t.scene.meshes[static_cast<size_t>(mesh)].colors.assign(4, {1, 1, 1, 0.5f});
  ShapeDescription& shape = t.AddShape(MeshShape{mesh}, t.Diffuse({}));
  shape.has_alpha = true;
  shape.alpha.texture = 0;
  const TileMean mean = RenderMapped(t.scene, SquareSettings(8, 256, 2));
  EXPECT_NEAR(mean.mean.g, 1 - 0.8 * 0.5, 5 * static_cast<double>(mean.standard_error.g) + 1e-3);
}

// Light from an image texture counts for the light's own group.
TEST_F(MappedSurfaceTest, ImageLightsEmitIntoTheirGroup) {
  Write(2, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}});
  TestScene t = LitRoom(1);
  t.scene.area_lights[0].file = "map.pfm";
  t.scene.area_lights[0].scale.scale = 5;
  t.scene.area_lights[0].group = "photo";
  PointLight point_light;
  point_light.intensity.rgb = Rgb::Gray(0.3f);
  point_light.from = {0.4f, 0, -0.5f};
  t.scene.lights.push_back({point_light, {}, {}, {}, "lamp"});
  FrameSettings settings = SquareSettings(16, 16, 5);
  settings.outputs.light_groups = {"lamp", "photo"};
  const FilmTile tile = RenderAll(*CompileMapped(t.scene, settings));
  ASSERT_EQ(tile.mean_count(), 6u);
  std::array<double, 2> totals{};
  for (size_t p = 0; p < tile.plane_size(); ++p) {
    const double light_red = tile.mean(0, 0)[p], image_red = tile.mean(3, 0)[p];
    const double red = tile.channel(FilmChannel::kRedHi)[p];
    EXPECT_NEAR(light_red + image_red, red, 1e-5 * red + 1e-7);
    totals[0] += light_red;
    totals[1] += image_red;
  }
  EXPECT_GT(totals[0], 0.1);
  EXPECT_GT(totals[1], 0.1);
}

// Only the size of the scene differs, so every bit of the image is the same.
TEST_F(MappedSurfaceTest, ScalingChangesNoBit) {
  Write(2, kStrongNormals);
  const auto render = [&](double scale) {
    TestScene t = LitRoom(scale);
    MapNormals(&t);
    t.scene.area_lights[0].file = "map.pfm";
    t.scene.area_lights[0].scale.scale = 5;
    return RenderAll(*CompileMapped(t.scene, SquareSettings(16, 16, 5)));
  };
  const FilmTile one = render(1);
  for (const int exponent : {-20, 20}) {
    const FilmTile scaled = render(std::ldexp(1.0, exponent));
    for (const FilmChannel channel : {FilmChannel::kRedHi, FilmChannel::kGreenHi}) {
      for (size_t i = 0; i < one.plane_size(); ++i) {
        ASSERT_EQ(scaled.channel(channel)[i], one.channel(channel)[i]) << exponent << ' ' << i;
      }
    }
  }
}

// In a mirrored pair of instances, the second one shows the mirror image of the first one's map:
// seen from mirrored positions, both have the same mean.
TEST_F(MappedSurfaceTest, MirroredInstancesAreMirrored) {
  Write(2, kStrongNormals);
  const auto render = [&](double side) {
    TestScene t({1.5 * side, 0.5, -4}, {0, 0, 0}, 35);
    DistantLight sun;
    sun.radiance.rgb = Rgb::Gray(2);
    sun.from = {2 * side, 1, -1};
    t.scene.lights.push_back({sun, {}, {}, {}});
    t.AddLooseShape(SphereShape{1, -1, 1, 360}, t.Diffuse(Rgb::Gray(0.8f)));
    t.scene.objects.push_back({"ball", {0}, {}});
    ObjectInstance instance;
    instance.object = 0;
    const Matrix4 placed = ScaleMatrix({side, 1.25, 0.75});
    instance.world_from_instance.start = instance.world_from_instance.end = placed;
    t.scene.instances.push_back(instance);
    MapNormals(&t);
    return RenderMapped(t.scene, SquareSettings(24, 64, 2));
  };
  const TileMean plain = render(1), mirrored = render(-1);
  EXPECT_GT(plain.mean.g, 0.01f);
  const double error = std::hypot(static_cast<double>(plain.standard_error.g),
                                  static_cast<double>(mirrored.standard_error.g));
  EXPECT_NEAR(plain.mean.g, mirrored.mean.g, 5 * error);
}

// --- Emission ------------------------------------------------------------------------------------

// Black except for one bright texel and a dim region.
std::vector<Rgb> Spotlit(int size) {
  std::vector<Rgb> texels(static_cast<size_t>(size) * static_cast<size_t>(size));
  texels[static_cast<size_t>(2 * size + size / 2)] = {90, 60, 30};
  texels[static_cast<size_t>((size - 3) * size + 1)] = {4, 4, 8};
  return texels;
}

int32_t ImageLight(TestScene* t, bool two_sided = false) {
  const int32_t light = t->AreaLight({}, two_sided);
  t->scene.area_lights.back().file = "map.pfm";
  return light;
}

// A screen above the origin that emits downwards, with uvs in the unit square.
void AddScreen(TestScene* t, bool two_sided) {
  const int32_t mesh = t->Quad({-1, 1, -1}, {1, 1, -1}, {1, 1, 1}, {-1, 1, 1});
  t->scene.meshes.back().uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  t->AddShape(MeshShape{mesh}, t->Diffuse({})).area_light = ImageLight(t, two_sided);
}

Vec3f CosineDirection(Vec2f u) {
  const Vec3f w = SampleCosineHemisphere(u);
  return {w.x, w.z, w.y};
}

constexpr uint64_t kPoints = 4096;

// Irradiance (red) at the origin, facing up: by BSDF samples of a diffuse surface only, by light
// samples only, and by both with multiple importance sampling.
struct Irradiance {
  Estimate by_bsdf, by_light, by_both;
};
Irradiance Measure(const CompiledScene& scene) {
  const Vec3f p{0, 0, 0}, n{0, 1, 0};
  const auto cosine_pdf = [&](Vec3f wi) {
    return std::fmax(Dot(wi, n), 0.0f) * static_cast<float>(1 / std::numbers::pi);
  };
  const auto hit = [&](const std::array<float, 4>& u, bool weighed) -> double {
    Ray ray;
    ray.o = p;
    ray.d = CosineDirection({u[1], u[2]});
    RawHit raw;
    if (!scene.tracer->Intersect(ray, &raw)) return 0;
    const SurfacePoint point = MakeSurfacePoint<kAllTraits>(scene.geometry, ray, raw);
    if (point.emitter == kNoEmitter) return 0;
    const Rgb radiance = scene.lights->EmitterRadianceAt<kAllTraits>(
        point.emitter, point.EmitterNormal(), -ray.d, point.uv, {});
    double weight = 1;
    if (weighed) {
      weight = WeightOf(cosine_pdf(ray.d),
                        scene.lights->PdfEmitter<kAllTraits>(point.emitter, p, n, ray.d, point.p));
    }
    return std::numbers::pi * static_cast<double>(radiance.r) * weight;
  };
  const auto light = [&](const std::array<float, 4>& u, bool weighed) -> double {
    const auto sample = scene.lights->Sample<kAllTraits>(p, n, u[0], {u[1], u[2]});
    if (!sample || Dot(sample->wi, n) <= 0) return 0;
    const float weight = weighed ? WeightOf(sample->pdf, cosine_pdf(sample->wi)) : 1.0f;
    return static_cast<double>(sample->radiance.r) * static_cast<double>(Dot(sample->wi, n)) *
           static_cast<double>(weight) / static_cast<double>(sample->pdf);
  };
  return {EstimateMean(kPoints, [&](const auto& u) { return hit(u, false); }),
          EstimateMean(kPoints, [&](const auto& u) { return light(u, false); }),
          EstimateMean(kPoints, [&](const auto& u) {
            return hit({u[3], u[2], u[0], u[1]}, true) + light(u, true);
          })};
}
void ExpectAgreement(const Irradiance& e) {
  const auto agree = [](const Estimate& a, const Estimate& b) {
    EXPECT_GT(a.mean, 0);
    EXPECT_NEAR(a.mean, b.mean, 5 * std::hypot(a.standard_error, b.standard_error));
  };
  agree(e.by_bsdf, e.by_light);
  agree(e.by_bsdf, e.by_both);
}

TEST_F(MappedSurfaceTest, HitsAndLightSamplesOfAnImageAgree) {
  Write(16, Spotlit(16));
  for (const bool two_sided : {false, true}) {
    SCOPED_TRACE(two_sided);
    TestScene t({0, 0, -4}, {0, 0, 0}, 40);
    t.SetCamera({0, 0, 0}, {0, 1, 1}, 40);
    AddScreen(&t, two_sided);
    const CompiledScenePtr scene = CompileMapped(t.scene, SquareSettings(4, 1, 1));
    const Irradiance e = Measure(*scene);
    ExpectAgreement(e);
    // Light sampling follows the brightness of the image.
    EXPECT_LT(e.by_light.standard_error, 0.25 * e.by_bsdf.standard_error);
  }
}

TEST_F(MappedSurfaceTest, ImagesOnDisksAndSpheresAgree) {
  Write(16, Spotlit(16));
  for (const bool is_disk : {false, true}) {
    TestScene t({0, 0, -4}, {0, 0, 0}, 40);
    t.SetCamera({0, 0, 0}, {0, 1, 1}, 40);
    const int32_t light = ImageLight(&t, true);
    const Matrix4 over = TranslateMatrix({0.1, 2, 0}) * RotateMatrix(70, {1, 0.2, 0});
    if (is_disk) {
      t.AddShape(DiskShape{1, 0.2f, 0, 360}, t.Diffuse({}), over).area_light = light;
    } else {
      t.AddShape(SphereShape{1, -1, 1, 360}, t.Diffuse({}), over).area_light = light;
    }
    SCOPED_TRACE(is_disk);
    ExpectAgreement(Measure(*CompileMapped(t.scene, SquareSettings(4, 1, 1))));
  }
}

// A constant image equals a plain light: the unit square at distance 1 gives the point below it an
// irradiance of 0.752274688454 times its radiance (row L4).
TEST_F(MappedSurfaceTest, ConstantImageEqualsAConstantEmitter) {
  Write(4, std::vector<Rgb>(16, Rgb::Gray(3)));
  TestScene t({0, 0, 0}, {0, 1, 1}, 40);
  AddScreen(&t, false);
  t.scene.shapes[0].world_from_object.start = t.scene.shapes[0].world_from_object.end =
      ScaleMatrix({0.5, 1, 0.5});
  t.scene.area_lights[0].scale.scale = 0.5f;
  const CompiledScenePtr scene = CompileMapped(t.scene, SquareSettings(4, 1, 1));
  const Estimate e = testing::EstimateIrradiance(*scene->lights, {0, 0, 0}, {0, 1, 0});
  testing::ExpectNear(e, 1.5 * 0.752274688454);
}

// The camera sees the image itself: its mean over the screen.
TEST_F(MappedSurfaceTest, CameraSeesTheImage) {
  Write(2, {{1, 2, 3}, {5, 0, 1}, {0, 0, 0}, {2, 2, 4}});
  for (const ColorTransport color : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
    TestScene t({0, 0, 0}, {0, 1, 0}, 90, {0, 0, 1});
    AddScreen(&t, false);
    FrameSettings settings = SquareSettings(8, 256, 0);
    settings.color = color;
    const TileMean mean = RenderMapped(t.scene, settings);
    // Clamped at its edges and bilinear: each texel has a weight of a quarter.
    const Rgb expected{2, 1, 2};
    for (size_t c = 0; c < 3; ++c) {
      EXPECT_NEAR(mean.mean[c], expected[c],
                  5 * static_cast<double>(mean.standard_error[c]) + 0.005);
    }
  }
}

// Lights with alpha, as in pbrt-v4: the opaque part emits; a light that is transparent everywhere
// emits as a whole, but no ray hits it.
TEST_F(MappedSurfaceTest, EmittersHaveCutOuts) {
  const auto floor_under = [&](float alpha, float* seen) {
    TestScene t({0, 0.4, -1}, {0, 0, 0}, 20);
    t.AddShape(MeshShape{t.Quad({-3, 0, -3}, {-3, 0, 3}, {3, 0, 3}, {3, 0, -3})},
               t.Diffuse(Rgb::Gray(0.5f)));
    const int32_t mesh = t.Quad({-1, 1, -1}, {1, 1, -1}, {1, 1, 1}, {-1, 1, 1});
    ShapeDescription& point_light = t.AddShape(MeshShape{mesh}, t.Diffuse({}));
    point_light.area_light = t.AreaLight(Rgb::Gray(4));
    point_light.has_alpha = true;
    point_light.alpha.value = alpha;
    const TileMean floor = RenderMapped(t.scene, SquareSettings(8, 256, 1));
    t.SetCamera({0, 0.1, 0}, {0, 1, 0.01}, 20);
    *seen = RenderMapped(t.scene, SquareSettings(8, 256, 0)).mean.g;
    return floor;
  };
  float seen = 0;
  const TileMean whole = floor_under(1, &seen);
  EXPECT_EQ(seen, 4);
  const TileMean part = floor_under(0.25f, &seen);
  EXPECT_NEAR(seen, 1, 0.1);
  EXPECT_NEAR(part.mean.g, 0.25f * whole.mean.g,
              5 * static_cast<double>(part.standard_error.g) + 1e-4);
  const TileMean unseen = floor_under(0, &seen);
  EXPECT_EQ(seen, 0);
  EXPECT_NEAR(unseen.mean.g, whole.mean.g, 5 * static_cast<double>(unseen.standard_error.g) + 1e-3);
}

}  // namespace
}  // namespace sheaf::render
