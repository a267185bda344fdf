// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Compares spectral transport with quadrature, and with RGB transport where the two must agree. The
// tolerance of every mean is ExpectMean's: 5 standard errors.
#include <gtest/gtest.h>

#include "common/scene/spectrum/spectrum.h"
#include "tests/support/colors.h"
#include "tests/support/test_scene.h"
#include "worker/render/color/spectral_color.h"
#include "worker/render/traits/trait_set.h"

namespace sheaf::render {
namespace {

using sheaf::testing::Named;
using sheaf::testing::RgbSpec;

FrameSettings InSpectra(FrameSettings settings) {
  settings.color = ColorTransport::kSpectral;
  return settings;
}

// The film's color for the spectral radiance value(nm) times the light of RGB white.
template <typename Function>
Rgb UnderWhite(const Function& value) {
  Rgb sum;
  for (size_t i = 0; i < kSpectrumCount; ++i) {
    const double nm = kSpectrumFirstNm + static_cast<double>(i);
    const std::array<double, 3> observer = ObserverRgb(nm);
    for (size_t c = 0; c < 3; ++c) {
      sum[c] += static_cast<float>(observer[c] * UnitD65(nm) * value(static_cast<float>(nm)));
    }
  }
  return sum;
}

// Quadrature in steps of 1 nm against a continuous density: a few parts in 1e4.
void ExpectColor(const TileMean& measured, Rgb expected) {
  EXPECT_EQ(measured.non_finite, 0u);
  for (size_t c = 0; c < 3; ++c) {
    const double allowed = 5 * static_cast<double>(measured.standard_error[c]) + 5e-4;
    EXPECT_NEAR(measured.mean[c], expected[c], allowed) << "channel " << c;
  }
}

// Inside a closed sphere that emits E and reflects rho, radiance is E / (1 - rho) at every
// wavelength. RGB transport cannot reproduce the color of many reflections (it would give 1 / (1 -
// rho) per channel).
TEST(SpectralTransportTest, InterreflectionSaturatesByTheSpectrum) {
  const Rgb rho{0.6f, 0.3f, 0.1f};
  TestScene t({0, 0, 0}, {0, 0, 1}, 60);
  t.AddShape(SphereShape{1, -1, 1, 360}, t.Diffuse(rho)).area_light = t.AreaLight(Rgb::Gray(1));
  t.scene.shapes.back().reverse_orientation = true;
  const SpectralColor spectrum = SpectralColor::Make(RgbSpec(rho), ColorRole::kReflectance);
  const Rgb expected = UnderWhite([&](float nm) { return 1 / (1 - spectrum.At(nm)); });
  ExpectColor(RenderMean(t.scene, InSpectra(SquareSettings(8, 1024, 200))), expected);
  EXPECT_GT(std::fabs(expected.r - 1 / (1 - rho.r)), 0.02f);  // RGB's answer differs.
}

// A measured metal reflects each wavelength by its own index of refraction.
TEST(SpectralTransportTest, MetalsReflectTheirMeasuredSpectrum) {
  TestScene t({0, 0, -1}, {0, 0, 0}, 4);
  t.ConstantEnvironment(Rgb::Gray(1));
  ConductorMaterial gold;
  gold.eta.value = Named("metal-Au-eta");
  gold.k.value = Named("metal-Au-k");
  t.AddShape(MeshShape{t.Quad({-1, -1, 0}, {-1, 1, 0}, {1, 1, 0}, {1, -1, 0})},
             t.AddMaterial(gold));
  const Rgb expected = UnderWhite([&](float nm) {
    return ConductorNormalReflectance(EvaluateSpectrum(gold.eta.value, nm),
                                      EvaluateSpectrum(gold.k.value, nm));
  });
  ExpectColor(RenderMean(t.scene, InSpectra(SquareSettings(8, 1024, 4))), expected);
}

// Under a coat, a measured metal reflects each wavelength by its index relative to the coat's, with
// interreflections below the interface.
TEST(SpectralTransportTest, CoatedMetalsReflectTheirMeasuredSpectrum) {
  TestScene t({0, 0, -1}, {0, 0, 0}, 4);
  t.ConstantEnvironment(Rgb::Gray(1));
  CoatedConductorMaterial lacquered;
  lacquered.conductor.eta.value = Named("metal-Cu-eta");
  lacquered.conductor.k.value = Named("metal-Cu-k");
  lacquered.thickness = 0.1f;
  t.AddShape(MeshShape{t.Quad({-1, -1, 0}, {-1, 1, 0}, {1, 1, 0}, {1, -1, 0})},
             t.AddMaterial(lacquered));
  const double n = lacquered.eta, outside = (n - 1) * (n - 1) / ((n + 1) * (n + 1));
  const Rgb expected = UnderWhite([&](float nm) {
    const double kept = Exp(-0.2) * ConductorNormalReflectance(
                                        EvaluateSpectrum(lacquered.conductor.eta.value, nm) / n,
                                        EvaluateSpectrum(lacquered.conductor.k.value, nm) / n);
    return outside + (1 - outside) * (1 - outside) * kept / (1 - outside * kept);
  });
  ExpectColor(RenderMean(t.scene, InSpectra(SquareSettings(8, 1024, 4))), expected);
  // RGB transport uses the metal's color in the coat.
  const TileMean rgb = RenderMean(t.scene, SquareSettings(8, 16, 4));
  for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(rgb.mean[c], expected[c], 0.01) << c;
}

// Dispersion deflects each wavelength differently and absorbs none: under a constant sky the glass
// is invisible.
TEST(SpectralTransportTest, DispersiveGlassVanishesUnderAConstantSky) {
  TestScene t({0, 0, -4}, {0, 0, 0}, 40);
  t.ConstantEnvironment({0.9f, 1, 0.7f});
  DielectricMaterial glass;
  glass.eta.spectrum = Named("glass-BK7");
  glass.eta.mean = MeanIndex(glass.eta.spectrum);
  t.AddShape(SphereShape{1, -1, 1, 360}, t.AddMaterial(glass));
  const CompiledScenePtr scene = Compile(t.scene, SquareSettings(12, 1024, 1000));
  EXPECT_TRUE(Has(PlanOf(*scene).traits, Trait::kSpectral)) << "dispersion asks for wavelengths";
  const SpectralColor sky = SpectralColor::Make(RgbSpec({0.9f, 1, 0.7f}), ColorRole::kUnbounded);
  ExpectColor(MeanOf(RenderAll(*scene)), UnderWhite([&](float nm) { return sky.At(nm); }));
}

// The plan omits wavelengths if RGB is requested, for every scene.
TEST(SpectralTransportTest, UserSettingOverridesTheScene) {
  TestScene t({0, 0, -4}, {0, 0, 0}, 40);
  DielectricMaterial glass;
  glass.eta.spectrum = Named("glass-BK7");
  t.AddShape(SphereShape{1, -1, 1, 360}, t.AddMaterial(glass));
  FrameSettings settings = SquareSettings(4, 1, 1);
  EXPECT_TRUE(Has(MakeRenderPlan(t.scene, settings).traits, Trait::kSpectral));
  settings.color = ColorTransport::kRgb;
  EXPECT_FALSE(Has(MakeRenderPlan(t.scene, settings).traits, Trait::kSpectral));
}

// RGB colors outside the sRGB gamut require wavelengths, and are rendered with the correct color.
TEST(SpectralTransportTest, OutOfGamutColorsAreKept) {
  TestScene t({0, 0, -4}, {0, 0, 0}, 4);
  InfiniteLight sky;
  sky.radiance.rgb = {0, 0.6f, 0.2f};
  sky.radiance.is_out_of_gamut = true;
  sky.radiance.true_rgb = {-0.05f, 0.6f, 0.2f};
  t.scene.lights.push_back({sky, {}, {}, {}});
  const CompiledScenePtr scene = Compile(t.scene, SquareSettings(8, 1024, 1));
  EXPECT_TRUE(Has(PlanOf(*scene).traits, Trait::kSpectral));
  const TileMean mean = MeanOf(RenderAll(*scene));
  EXPECT_LT(mean.mean.r, -0.04f);
  ExpectColor(mean, sky.radiance.true_rgb);
}

// For grays both transports estimate the same image.
TEST(SpectralTransportTest, GrayScenesAgreeInBothTransports) {
  TestScene t({0.1, 0.2, -0.7}, {0, 0, 1}, 70);
  t.AddShape(MeshShape{t.Box({-1, -1, -1}, {1, 1, 1})}, t.Diffuse(Rgb::Gray(0.6f)));
  CoatedDiffuseMaterial coat;
  coat.roughness = {{0.2f, kNone}, {0.2f, kNone}, true};
  coat.reflectance.value.rgb = Rgb::Gray(0.5f);
  t.AddShape(SphereShape{0.25f, -0.25f, 0.25f, 360}, t.AddMaterial(coat),
             TranslateMatrix({0.3, -0.5, 0.4}));
  t.AddShape(MeshShape{t.Quad({-0.3f, 0.99f, -0.3f}, {0.3f, 0.99f, -0.3f}, {0.3f, 0.99f, 0.3f},
                              {-0.3f, 0.99f, 0.3f})},
             t.Diffuse({}))
      .area_light = t.AreaLight(Rgb::Gray(5));
  const FrameSettings settings = SquareSettings(16, 1024, 8);
  const TileMean rgb = RenderMean(t.scene, settings);
  const TileMean spectral = RenderMean(t.scene, InSpectra(settings));
  for (size_t c = 0; c < 3; ++c) {
    const double error = std::hypot(rgb.standard_error[c], spectral.standard_error[c]);
    EXPECT_NEAR(rgb.mean[c], spectral.mean[c], 5 * error + 5e-4 * rgb.mean[c]) << c;
  }
}

}  // namespace
}  // namespace sheaf::render
