// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hair and measured materials in whole images: furnaces, light from behind, scale, and the plan's
// description of them.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "tests/support/measured_builder.h"
#include "tests/support/temporary_path.h"
#include "tests/support/test_scene.h"
#include "worker/render/plan/render_plan.h"
#include "worker/render/traits/trait_set.h"

namespace sheaf::render {
namespace {

using sheaf::testing::MeasuredFileBuilder;

constexpr int kSpecialDepth = 1000;

HairMaterial WhiteHair(float beta) {
  HairMaterial hair;
  hair.pigment = HairMaterial::Pigment::kAbsorption;
  hair.color.value.rgb = {};
  hair.beta_m.value = hair.beta_n.value = beta;
  return hair;
}

// A strand along y about `at`: a tube with smooth normals, u along it and v around it.
int32_t Strand(TestScene* t, Vec3f at, float radius, float half_length) {
  TriangleMesh mesh;
  constexpr int kSides = 10;
  for (int i = 0; i <= kSides; ++i) {
    const float v = static_cast<float>(i) / kSides, phi = 2 * std::numbers::pi_v<float> * v;
    const Vec3f n{std::cos(phi), 0, std::sin(phi)};
    for (const float end : {0.0f, 1.0f}) {
      mesh.positions.push_back(at + n * radius + Vec3f{0, (2 * end - 1) * half_length, 0});
      mesh.normals.push_back(n);
      mesh.uvs.push_back({end, v});
    }
  }
  for (uint32_t i = 0; i < kSides; ++i) {
    for (const uint32_t k : {0u, 1u, 3u, 0u, 3u, 2u}) mesh.indices.push_back(2 * i + k);
  }
  t->scene.meshes.push_back(mesh);
  return static_cast<int32_t>(t->scene.meshes.size() - 1);
}

TestScene Strands(const HairMaterial& hair, double scale = 1) {
  TestScene t(Vec3d{0, 0, -4} * scale, Vec3d{}, 40);
  const int32_t material = t.AddMaterial(hair);
  const Matrix4 size = ScaleMatrix({scale, scale, scale});
  for (const float x : {-0.8f, -0.2f, 0.3f, 0.9f}) {
    t.AddShape(MeshShape{Strand(&t, {x, 0, 0.2f * x}, 0.15f, 1)}, material, size);
  }
  t.AddShape(CylinderShape{0.3f, -1, 1, 360}, material,
             size * TranslateMatrix({0, 0, 0.8}) * RotateMatrix(70, {0, 1, 0}));
  return t;
}

FrameSettings In(ColorTransport color, uint64_t samples) {
  FrameSettings settings = SquareSettings(12, samples, kSpecialDepth);
  settings.color = color;
  return settings;
}

TEST(HairTransportTest, M12_FurnaceUnderAConstantSky) {
  for (const ColorTransport color : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
    for (const float beta : {0.1f, 0.3f, 1.0f}) {
      SCOPED_TRACE(beta);
      TestScene t = Strands(WhiteHair(beta));
      t.ConstantEnvironment(Rgb::Gray(1));
      const TileMean mean = RenderMean(t.scene, In(color, 64));
      EXPECT_EQ(mean.non_finite, 0u);
      for (size_t c = 0; c < 3; ++c) {
        EXPECT_NEAR(mean.mean[c], 1, 5 * static_cast<double>(mean.standard_error[c]) + 1e-3);
      }
    }
  }
}

// Lights in front of the fiber and behind it must both contribute, or the furnace would be dark.
TEST(HairTransportTest, FurnaceOfAnEmitter) {
  TestScene t = Strands(WhiteHair(0.3f));
  t.AddShape(SphereShape{10, -10, 10, 360}, t.Diffuse({})).area_light =
      t.AreaLight(Rgb::Gray(1), true);
  const TileMean mean = RenderMean(t.scene, In(ColorTransport::kRgb, 256));
  EXPECT_EQ(mean.non_finite, 0u);
  EXPECT_NEAR(mean.mean.g, 1, 5 * static_cast<double>(mean.standard_error.g) + 2e-3);
}

// A strip seen from the front and lit from the back: its radiance is E times Chiang's f cos, which
// in the middle (h = 0) is almost only the TT highlight.
TEST(HairTransportTest, LightPassesThrough) {
  TestScene t({0, 0, -4}, {0, 0, 0}, 1);
  DistantLight sun;
  sun.radiance.rgb = Rgb::Gray(1);
  sun.from = {0, 0, 1};
  sun.to = {0, 0, 0};
  t.scene.lights.push_back({sun, {}, {}, {}});
  HairMaterial hair = WhiteHair(0.3f);
  hair.color.value.rgb = {0.1f, 0.5f, 2};
  hair.alpha_degrees.value = 0;
  TriangleMesh mesh;
  mesh.positions = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  mesh.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};  // Along x.
  mesh.indices = {0, 1, 2, 0, 2, 3};
  t.scene.meshes.push_back(mesh);
  t.AddShape(MeshShape{0}, t.AddMaterial(hair));
  const TileMean mean = RenderMean(t.scene, SquareSettings(4, 16, 1));
  // M_TT N_TT of v = .25 (.726 .3 + .812 .09)^2 = .0211664 at 0 with cos 1: e^(-1/v) I0(1/v) /
  // (v (1 - e^(-2/v))); s = .626657 (.265 .3 + 1.194 .09), 1 / (4 s tanh(pi / 2s)).
  const double v = 0.25 * std::pow(0.726 * 0.3 + 0.812 * 0.09 + 3.7 * std::pow(0.3, 20), 2);
  const double s = 0.626657069 * (0.265 * 0.3 + 1.194 * 0.09 + 5.372 * std::pow(0.3, 22));
  const double x = 1 / v;
  const double bessel = (1 + 1 / (8 * x) + 9 / (128 * x * x) + 225 / (3072 * x * x * x)) /
                        std::sqrt(2 * std::numbers::pi * x);
  const double along = bessel / (v * (1 - std::exp(-2 * x)));
  const double around = 1 / (4 * s * std::tanh(std::numbers::pi / (2 * s)));
  const double f = std::pow(0.55 / 2.55, 2);
  for (size_t c = 0; c < 3; ++c) {
    const double tt =
        (1 - f) * (1 - f) * std::exp(-2 * static_cast<double>(hair.color.value.rgb[c]));
    EXPECT_NEAR(mean.mean[c], tt * along * around, 0.02 * tt * along * around) << c;
  }
}

TEST(HairTransportTest, ScaleChangesNoBit) {
  const auto render = [](double scale) {
    HairMaterial hair;
    hair.alpha_degrees.value = 3;
    TestScene t = Strands(hair, scale);
    t.ConstantEnvironment({0.5f, 1, 2});
    return RenderAll(*Compile(t.scene, SquareSettings(16, 16, 8)));
  };
  const FilmTile expected = render(1);
  // The hair is visible, not only the sky.
  EXPECT_LT(MeanOf(expected).mean.b, 1.9f);
  EXPECT_GT(MeanOf(expected).mean.b, 0.1f);
  for (const int exponent : {-20, 20}) {
    const FilmTile scaled = render(std::ldexp(1.0, exponent));
    for (const FilmChannel channel :
         {FilmChannel::kRedHi, FilmChannel::kGreenHi, FilmChannel::kBlueLo}) {
      for (size_t i = 0; i < expected.plane_size(); ++i) {
        ASSERT_EQ(scaled.channel(channel)[i], expected.channel(channel)[i]) << exponent;
      }
    }
  }
}

// Melanins absorb blue most, pheomelanin even more so: of two hairs with equal absorption of red
// (0.419 x 0.3 = 0.187 x 0.672) the one with pheomelanin is redder.
TEST(HairTransportTest, MelaninsColor) {
  std::vector<Rgb> means;
  HairMaterial blond, red, black;
  blond.eumelanin.value = 0.3f;
  red.eumelanin.value = 0;
  red.pheomelanin.value = 0.3f * 0.419f / 0.187f;
  black.eumelanin.value = 8;
  for (const HairMaterial& hair : {blond, red, black}) {
    TestScene t = Strands(hair);
    t.ConstantEnvironment(Rgb::Gray(1));
    means.push_back(RenderMean(t.scene, SquareSettings(12, 64, 50)).mean);
  }
  EXPECT_GT(means[0].r, means[0].g);
  EXPECT_GT(means[0].g, means[0].b);
  EXPECT_NEAR(means[1].r, means[0].r, 0.01f);
  EXPECT_LT(means[1].b, means[0].b - 0.02f);
  EXPECT_LT(means[2].r, means[0].r - 0.1f);
}

TEST(HairTransportTest, PlanNamesTheCause) {
  TestScene t = Strands(WhiteHair(0.3f));
  const RenderPlan plan = MakeRenderPlan(t.scene, SquareSettings(4, 4, 4));
  EXPECT_TRUE(Has(plan.traits, Trait::kHair));
  EXPECT_FALSE(Has(plan.traits, Trait::kMeasured));
  EXPECT_FALSE(Has(plan.traits, Trait::kTextures));
  EXPECT_TRUE(Has(plan.variant_traits, Trait::kHair));
}

class MeasuredTransportTest : public ::testing::Test {
 protected:
  ~MeasuredTransportTest() override { std::filesystem::remove(path_); }

  // A ball of the material under a constant sky of radiance 1.
  TileMean Render(const MeasuredFileBuilder& builder, ColorTransport color) {
    builder.Write(path_);
    TestScene t({0, 0, -4}, {0, 0, 0}, 20);
    t.ConstantEnvironment(Rgb::Gray(1));
    t.AddShape(SphereShape{1, -1, 1, 360},
               t.AddMaterial(MeasuredMaterial{"paint.bsdf", !builder.IsIsotropic()}));
    TableFileSource files({{"paint.bsdf", path_}});
    CompileLimits limits;
    limits.build_threads = 1;
    const absl::StatusOr<CompiledScenePtr> scene =
        CompileScene(t.scene, In(color, 256), files, limits);
    EXPECT_TRUE(scene.ok()) << scene.status();
    return MeanOf(RenderAll(**scene));
  }

  const std::string path_ = sheaf::testing::TemporaryPath("measured.bsdf");
};

// Matte paint of a known spectrum, to the precision of its grids.
TEST_F(MeasuredTransportTest, MattePaintReflectsItsMeasurement) {
  MeasuredFileBuilder gray;
  gray.spectra_size = 33;
  for (const ColorTransport color : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
    const TileMean mean = Render(gray, color);
    EXPECT_EQ(mean.non_finite, 0u);
    for (size_t c = 0; c < 3; ++c) {
      EXPECT_NEAR(mean.mean[c], 0.5, 5 * static_cast<double>(mean.standard_error[c]) + 0.01) << c;
    }
  }
}

// One reflection of white light: RGB computed from the spectra when the file is read must match the
// result of spectral transport.
TEST_F(MeasuredTransportTest, RgbAgreesWithWavelengths) {
  MeasuredFileBuilder red;
  red.wavelengths = {400, 550, 600, 700};
  red.f_cos = [](Vec3d, Vec3d wi, double nm) {
    return (nm < 560 ? 0.2 : 0.8) / std::numbers::pi * wi.z;
  };
  const TileMean rgb = Render(red, ColorTransport::kRgb);
  const TileMean spectral = Render(red, ColorTransport::kSpectral);
  for (size_t c = 0; c < 3; ++c) {
    const double error = static_cast<double>(rgb.standard_error[c] + spectral.standard_error[c]);
    EXPECT_NEAR(rgb.mean[c], spectral.mean[c], 5 * error + 2e-3) << c;
  }
  EXPECT_GT(rgb.mean.r, rgb.mean.g);
}

TEST_F(MeasuredTransportTest, DamagedFilesAreErrors) {
  std::ofstream(path_) << "tensor_file";
  TestScene t({0, 0, -4}, {0, 0, 0}, 20);
  t.AddShape(SphereShape{1, -1, 1, 360}, t.AddMaterial(MeasuredMaterial{"paint.bsdf", false}));
  TableFileSource files({{"paint.bsdf", path_}});
  const absl::StatusOr<CompiledScenePtr> scene =
      CompileScene(t.scene, SquareSettings(4, 4, 4), files, CompileLimits{});
  ASSERT_FALSE(scene.ok());
  EXPECT_NE(scene.status().message().find("paint.bsdf: "), std::string::npos) << scene.status();
}

}  // namespace
}  // namespace sheaf::render
