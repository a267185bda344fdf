// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of subsurface scattering, named as in the catalogue (V1, V11, V12, V14, G2, G12). The
// tolerance of means is ExpectMean's 5 standard errors unless stated otherwise.
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "common/scene/half_space.h"
#include "gtest/gtest.h"
#include "tests/support/hard_case.h"
#include "tests/support/interior_scene.h"
#include "tests/support/long_tests.h"
#include "tests/support/naive_media.h"
#include "worker/render/bsdf/fresnel.h"

namespace sheaf::render {
namespace {

const SphereShape kBall{1, -1, 1, 360};

InteriorScene FurnaceScene(double fov_degrees = 30) {
  InteriorScene t({0.4, 0.7, -4}, {0, 0, 0}, static_cast<float>(fov_degrees));
  t.ConstantEnvironment(Rgb::Gray(1));
  return t;
}

// V11, V12: objects without absorption are invisible under a constant sky, for every index, shape,
// density and color.
TEST(SubsurfaceStability, V12WhiteFurnace) {
  struct Case {
    Rgb sigma_s;
    float g, eta;
    bool is_box;
  };
  for (const Case& c :
       {Case{Rgb::Gray(1), 0, 1.33f, false}, Case{Rgb::Gray(1e-3f), 0.5f, 1.5f, false},
        Case{Rgb::Gray(8), 0.9f, 1.33f, true}, Case{Rgb::Gray(3), -0.7f, 2.0f, false},
        Case{{1, 3, 9}, 0, 1.5f, true}, Case{{0.1f, 1, 10}, 0.8f, 1.1f, false},
        Case{Rgb::Gray(3), 0, 0.7f, false}, Case{Rgb::Gray(2), 0.3f, 1, true}}) {
    for (const bool spectral : {false, true}) {
      SCOPED_TRACE(std::to_string(c.eta) + " " + std::to_string(c.sigma_s.b));
      InteriorScene t = FurnaceScene();
      const int32_t subsurface = t.SubsurfaceOf({}, c.sigma_s, c.g, c.eta);
      if (c.is_box) {
        t.AddSubsurface(MeshShape{t.Box({-1, -1, -1}, {1, 1, 1})}, subsurface);
      } else {
        t.AddSubsurface(kBall, subsurface);
      }
      FrameSettings settings = SquareSettings(8, DrawCount(64, 2048), 100);
      if (spectral) settings.color = ColorTransport::kSpectral;
      const Rendered rendered = RenderCounted(t.scene, settings);
      EXPECT_EQ(rendered.mean.non_finite, 0u);
      EXPECT_EQ(rendered.stats.broken_nestings, 0u);
      EXPECT_EQ(rendered.stats.long_walks, 0u);
      for (size_t i = 0; i < 3; ++i) {
        EXPECT_NEAR(rendered.mean.mean[i], 1, 5 * rendered.mean.standard_error[i] + 5e-4);
      }
    }
  }
}

// A rough boundary conserves energy up to the rounding of its compensation tables.
TEST(SubsurfaceStability, V12RoughFurnace) {
  InteriorScene t = FurnaceScene();
  t.AddSubsurface(kBall, t.SubsurfaceOf({}, Rgb::Gray(4), 0, 1.4f, 0.3f));
  const Rendered rendered = RenderCounted(t.scene, SquareSettings(8, DrawCount(128, 2048), 100));
  EXPECT_NEAR(rendered.mean.mean.g, 1, 5 * rendered.mean.standard_error.g + 5e-3);
}

// V1: with matched index a half-space has Chandrasekhar's plane albedo, as a plain medium has. A
// walk counts as one bounce.
InteriorScene HalfSpace(double mu, float albedo, double density, float eta) {
  const double height = 1, side = height * std::sqrt(1 - mu * mu) / mu;
  InteriorScene t({side, height, 0}, {0, 0, 0}, 0.01f, {0, 0, 1});
  t.ConstantEnvironment(Rgb::Gray(1));
  const auto sigma_t = static_cast<float>(density);
  const int32_t subsurface =
      t.SubsurfaceOf(Rgb::Gray((1 - albedo) * sigma_t), Rgb::Gray(albedo * sigma_t), 0, eta);
  const auto size = static_cast<float>(1000 + 4e4 / density);
  t.AddSubsurface(MeshShape{t.Box({-size, -size, -size}, {size, 0, size})}, subsurface);
  return t;
}

TEST(SubsurfaceStability, V1MatchedHalfSpaceHasItsPlaneAlbedo) {
  struct Row {
    float albedo;
    double from_above, at_half;
  };
  for (const Row& row : {Row{0.5f, .115226, .160144}, Row{0.8f, .285255, .367970},
                         Row{0.9f, .414947, .507939}, Row{0.99f, .752721, .815140}}) {
    SCOPED_TRACE(row.albedo);
    const FrameSettings settings = SquareSettings(8, DrawCount(128, 4096), 2);
    ExpectMean(RenderCounted(HalfSpace(1, row.albedo, 1, 1).scene, settings).mean,
               Rgb::Gray(static_cast<float>(row.from_above)));
    ExpectMean(RenderCounted(HalfSpace(0.5, row.albedo, 1, 1).scene, settings).mean,
               Rgb::Gray(static_cast<float>(row.at_half)));
  }
}

// A walk counts as one bounce under a light too, in a scene with media of other kinds: a ball of
// matched index equals the ball of a plain medium, in which every vertex is a bounce. No bounce is
// left for the walk, and it needs none.
TEST(SubsurfaceStability, V1WalkUnderALightIsOneBounce) {
  const auto lit = [](bool is_subsurface) {
    InteriorScene t({0.3, 0.8, -4}, {0, 0, 0}, 30);
    MediumDescription medium;
    medium.name = "thin";
    medium.sigma_s.rgb = Rgb::Gray(1e-6f);
    t.scene.media.push_back(medium);
    t.AddShape(MeshShape{t.Box({-3, -3, -3}, {3, 3, 3})}, t.AddMaterial(InterfaceMaterial{}))
        .media.inside = 0;
    const Rgb sigma_a{0.1f, 0.2f, 0.4f}, sigma_s{2, 1, 0.5f};
    if (is_subsurface) {
      t.AddSubsurface(kBall, t.SubsurfaceOf(sigma_a, sigma_s, 0.3f, 1));
    } else {
      medium.name = "plain";
      medium.sigma_a.rgb = sigma_a;
      medium.sigma_s.rgb = sigma_s;
      medium.g = 0.3f;
      t.scene.media.push_back(medium);
      t.AddShape(kBall, t.AddMaterial(InterfaceMaterial{})).media.inside = 1;
    }
    PointLight light;
    light.intensity.rgb = {9, 8, 7};
    light.from = {-1.2f, 1.5f, -0.8f};
    t.scene.lights.push_back({light, {}, {}, {}});
    return RenderCounted(t.scene,
                         SquareSettings(16, DrawCount(512, 8192), is_subsurface ? 0 : 1 << 16));
  };
  const Rendered subsurface = lit(true), plain = lit(false);
  ExpectSameMean(subsurface.mean, plain.mean);
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_LT(subsurface.mean.standard_error[c], 0.01 * subsurface.mean.mean[c]);
  }
}

// The fraction of the entered light that leaves, by Gaussian quadrature over the cosines of the
// views.
double MeasuredReflectance(float albedo, double density, float eta, double* standard_error) {
  constexpr std::array<double, 5> kMu{0.0469100770, 0.2307653449, 0.5, 0.7692346551, 0.9530899230},
      kWeight{0.1184634425, 0.2393143352, 0.2844444444, 0.2393143352, 0.1184634425};
  double left = 0, entered = 0, variance = 0;
  for (size_t i = 0; i < kMu.size(); ++i) {
    const double mu = kMu[i], cosine_weight = kWeight[i] * mu;
    const double mu_in = std::sqrt(1 - (1 - mu * mu) / static_cast<double>(eta * eta));
    const double e = static_cast<double>(eta);
    const double p = (e * mu - mu_in) / (e * mu + mu_in), s = (mu - e * mu_in) / (mu + e * mu_in);
    const double mirrored = (p * p + s * s) / 2;
    const Rendered rendered = RenderCounted(HalfSpace(mu, albedo, density, eta).scene,
                                            SquareSettings(8, DrawCount(128, 4096), 2));
    EXPECT_EQ(rendered.mean.non_finite, 0u);
    EXPECT_EQ(rendered.stats.broken_nestings, 0u);
    left += cosine_weight * (static_cast<double>(rendered.mean.mean.g) - mirrored);
    entered += cosine_weight * (1 - mirrored);
    variance += std::pow(cosine_weight * static_cast<double>(rendered.mean.standard_error.g), 2);
  }
  *standard_error = std::sqrt(variance) / entered;
  return left / entered;
}

// V14: a half-space reflects HalfSpaceReflectance, the function that converts "reflectance" to
// coefficients, at any density: free paths of 1 / density scene units. Below about 0.01 of them,
// rays cannot resolve the walk. Tolerance: 5 standard errors and 0.003 for both quadratures.
TEST(SubsurfaceStability, V14ReflectanceAtAnyDensity) {
  for (const double density : {1.0, 50.0, 100.0, 1e3, 1e6, 1e15}) {
    for (const float albedo : {0.6f, 0.95f}) {
      SCOPED_TRACE(std::to_string(density) + " " + std::to_string(albedo));
      double standard_error = 0;
      const double measured = MeasuredReflectance(albedo, density, 1.33f, &standard_error);
      EXPECT_LT(standard_error, 0.01);
      EXPECT_NEAR(measured, HalfSpaceReflectance(static_cast<double>(albedo), 1.33),
                  5 * standard_error + 0.003);
    }
  }
}

// A subsurface medium under a constant sky that fills the whole ground, seen at a cosine.
InteriorScene Ground(double mu) {
  const double height = 1, side = height * std::sqrt(1 - mu * mu) / mu;
  InteriorScene t({side, height, 0.5}, {0, 0, 0.5}, 0.01f, {0, 0, 1});
  t.ConstantEnvironment(Rgb::Gray(1));
  return t;
}
Rendered RenderGround(InteriorScene* t, int32_t subsurface, bool spectral) {
  t->AddSubsurface(MeshShape{t->Box({-1000, -1000, -1000}, {1000, 0, 1000})}, subsurface);
  FrameSettings settings = SquareSettings(8, DrawCount(64, 4096), 2);
  settings.color = spectral ? ColorTransport::kSpectral : ColorTransport::kRgb;
  Rendered rendered = RenderCounted(t->scene, settings);
  EXPECT_EQ(rendered.mean.non_finite, 0u);
  EXPECT_EQ(rendered.stats.broken_nestings, 0u);
  return rendered;
}

// V14: a medium with a reflectance texture reflects at each point the texture's value, as a medium
// of that single color does: in RGB, and for each wavelength. Free paths are a thousandth of the
// stripes.
TEST(SubsurfaceStability, V14TexturedSubsurfaceReflectsItsTexture) {
  const Rgb colors[2] = {{0.8f, 0.35f, 0.1f}, {0.05f, 0.3f, 0.7f}};
  constexpr float kFreePath = 1e-3f, kEta = 1.33f;
  for (const bool spectral : {false, true}) {
    for (const size_t stripe : {0, 1}) {
      SCOPED_TRACE((spectral ? "spectral " : "RGB ") + std::to_string(stripe));
      InteriorScene plain = Ground(0.7), striped = Ground(0.7);
      const int32_t one_color =
          plain.SubsurfaceWithReflectance(colors[stripe], kNone, kFreePath, 0, kEta);
      const int32_t texture = striped.Stripes(colors[stripe], colors[1 - stripe], {0, 0, 1});
      const int32_t two_colors = striped.SubsurfaceWithReflectance({}, texture, kFreePath, 0, kEta);
      ExpectSameMean(RenderGround(&striped, two_colors, spectral).mean,
                     RenderGround(&plain, one_color, spectral).mean);
    }
  }
}

// V14: under a constant sky the requested reflectance results, also for a spectrum: the mean over
// the views, without the mirror reflection of the boundary. Tolerance: as above.
TEST(SubsurfaceStability, V14ReflectanceMatchesTheRequest) {
  const Rgb asked{0.8f, 0.35f, 0.1f};
  constexpr std::array<double, 5> kMu{0.0469100770, 0.2307653449, 0.5, 0.7692346551, 0.9530899230},
      kWeight{0.1184634425, 0.2393143352, 0.2844444444, 0.2393143352, 0.1184634425};
  for (const bool spectral : {false, true}) {
    for (const bool is_textured : {false, true}) {
      SCOPED_TRACE((spectral ? "spectral " : "RGB ") + std::to_string(is_textured));
      Rgb left, error2;
      double entered = 0;
      for (size_t i = 0; i < kMu.size(); ++i) {
        const double mu = kMu[i], cosine_weight = kWeight[i] * mu;
        InteriorScene t = Ground(mu);
        const int32_t texture = is_textured ? t.Stripes(asked, asked, {0, 0, 1}) : kNone;
        const TileMean mean =
            RenderGround(&t, t.SubsurfaceWithReflectance(asked, texture, 1e-2f, 0, 1.33f), spectral)
                .mean;
        const double mirrored =
            static_cast<double>(FresnelDielectric(static_cast<float>(mu), 1.33f).reflectance);
        entered += cosine_weight * (1 - mirrored);
        for (size_t c = 0; c < 3; ++c) {
          left[c] +=
              static_cast<float>(cosine_weight * (static_cast<double>(mean.mean[c]) - mirrored));
          error2[c] += static_cast<float>(
              std::pow(cosine_weight * static_cast<double>(mean.standard_error[c]), 2));
        }
      }
      for (size_t c = 0; c < 3; ++c) {
        EXPECT_NEAR(static_cast<double>(left[c]) / entered, static_cast<double>(asked[c]),
                    5 * std::sqrt(static_cast<double>(error2[c])) / entered + 0.003)
            << "channel " << c;
      }
    }
  }
}

// A boundary of matched index is invisible, but a texture on it still applies to the interior.
TEST(SubsurfaceStability, TexturesApplyAtMatchedBoundaries) {
  const auto ball = [](bool is_textured) {
    InteriorScene t = FurnaceScene();
    const Rgb color{0.8f, 0.35f, 0.1f};
    const int32_t texture = is_textured ? t.Stripes(color, color, {0, 0, 1}) : kNone;
    t.AddSubsurface(kBall, t.SubsurfaceWithReflectance(color, texture, 0.1f, 0.4f, 1));
    return RenderCounted(t.scene, SquareSettings(8, DrawCount(256, 4096), 3)).mean;
  };
  ExpectSameMean(ball(true), ball(false));
}

// V14: the same for a ball whose free paths are a millionth of its radius: under a constant sky it
// reflects as the half-space does.
TEST(SubsurfaceStability, V14ShortMeanFreePathsAreDiffuse) {
  std::vector<Rendered> balls;
  for (size_t i = 0; i < 2; ++i) {
    InteriorScene t = FurnaceScene();
    const float density = i == 0 ? 1e6f : 1e8f;
    t.AddSubsurface(kBall,
                    t.SubsurfaceOf(Rgb::Gray(0.1f * density), Rgb::Gray(0.9f * density), 0, 1.4f));
    balls.push_back(RenderCounted(t.scene, SquareSettings(8, DrawCount(256, 4096), 3)));
    EXPECT_EQ(balls[i].mean.non_finite, 0u);
    EXPECT_EQ(balls[i].stats.broken_nestings, 0u);
  }
  const float expected = balls[0].mean.mean.g;
  ExpectHardCase(
      {.row = "V14",
       .figure = "reflectance at free paths of 1e-8, as at 1e-6",
       .expected = expected,
       .measured = balls[1].mean.mean.g,
       .standard_error = std::hypot(balls[0].mean.standard_error.g, balls[1].mean.standard_error.g),
       .naive = expected * naive::PartOfSteps(1e-8f, 1000),
       .naive_by = "times the part of 1000 steps that a coordinate of 1 takes"});
}

// From thin to thick only absorbed light is lost.
TEST(SubsurfaceStability, V14AnyThickness) {
  for (const float thickness : {1e-3f, 1e-1f, 10.0f, 1e3f, 1e6f}) {
    SCOPED_TRACE(thickness);
    InteriorScene t = FurnaceScene();
    t.AddSubsurface(kBall, t.SubsurfaceOf(Rgb{0.01f, 0.1f, 0.5f} * thickness,
                                          Rgb{1, 0.5f, 0.1f} * thickness, 0.2f, 1.4f, 0.1f));
    const Rendered rendered = RenderCounted(t.scene, SquareSettings(8, 64, 8));
    EXPECT_EQ(rendered.mean.non_finite, 0u);
    EXPECT_EQ(rendered.stats.broken_nestings, 0u);
    for (size_t c = 0; c < 3; ++c) {
      EXPECT_LT(rendered.mean.mean[c], 1.01f + 5 * rendered.mean.standard_error[c]);
      EXPECT_GT(rendered.mean.mean[c], 0.3f);
    }
  }
}

// A walk of any length counts as one bounce: a convex ball reflects no light onto itself and has
// its full brightness at depth 1.
TEST(SubsurfaceStability, WalkIsOneBounce) {
  InteriorScene t = FurnaceScene();
  t.AddSubsurface(kBall, t.SubsurfaceOf(Rgb::Gray(0.1f), Rgb::Gray(5), 0, 1.33f));
  const Rendered shallow = RenderCounted(t.scene, SquareSettings(8, 64, 1));
  const Rendered deep = RenderCounted(t.scene, SquareSettings(8, 64, 50));
  EXPECT_TRUE(shallow.film == deep.film);
  EXPECT_GT(shallow.mean.mean.g, 0.3f);
}

// A plain medium inside glass equals the subsurface medium if the depth is unlimited.
TEST(SubsurfaceStability, AgreesWithGlassAroundAMedium) {
  for (const float roughness : {0.0f, 0.25f}) {
    for (const Rgb sigma_s : {Rgb::Gray(2), Rgb{0.5f, 2, 6}}) {
      const auto slab = [&](bool by_hand) {
        InteriorScene t({0.3, 0.4, -4}, {0, 0, 0}, 40);
        t.ConstantEnvironment({1, 0.5f, 0.2f});
        t.AddShape(MeshShape{t.Quad({-2, 2.5f, -2}, {2, 2.5f, -2}, {2, 2.5f, 2}, {-2, 2.5f, 2})},
                   t.Diffuse({}))
            .area_light = t.AreaLight(Rgb::Gray(4));
        const int32_t subsurface =
            t.SubsurfaceOf({0.1f, 0.2f, 0.3f}, sigma_s, 0.3f, 1.4f, roughness);
        const MeshShape box{t.Box({-1, -1, -0.4f}, {1, 1, 0.4f})};
        if (!by_hand) {
          t.AddSubsurface(box, subsurface);
          return RenderCounted(t.scene, SquareSettings(16, DrawCount(256, 4096), 1000));
        }
        t.scene.media[0].is_subsurface = false;
        DielectricMaterial glass;
        glass.roughness = {{roughness, kNone}, {roughness, kNone}, false};
        glass.eta.mean = 1.4f;
        t.AddShape(box, t.AddMaterial(glass)).media.inside = 0;
        return RenderCounted(t.scene, SquareSettings(16, DrawCount(256, 4096), 1000));
      };
      const Rendered subsurface = slab(false), by_hand = slab(true);
      ExpectSameMean(subsurface.mean, by_hand.mean);
      EXPECT_EQ(by_hand.stats.broken_nestings, 0u);
    }
  }
}

// G2: 2^20 times as large or small, with matching coefficients, the image is the same to the bit;
// also if walks do not use rays.
TEST(SubsurfaceStability, G2ScaleKeepsTheBits) {
  for (const double density : {3.0, 1e7}) {
    const auto scaled = [&](double scale) {
      TestScene room = LitRoom(scale);
      InteriorScene t(room);
      const auto unit = static_cast<float>(density / scale);
      const int32_t subsurface =
          t.SubsurfaceOf(Rgb{0.1f, 0.2f, 0.3f} * unit, Rgb{1, 0.9f, 0.8f} * unit, 0.2f, 1.4f, 0.2f);
      t.AddSubsurface(SphereShape{0.25f, -0.25f, 0.25f, 360}, subsurface,
                      ScaleMatrix({scale, scale, scale}) * TranslateMatrix({-0.3, -0.5, 0.4}));
      return RenderCounted(t.scene, SquareSettings(12, 16, 6));
    };
    const Rendered one = scaled(1);
    EXPECT_GT(one.mean.mean.g, 0.01f);
    for (const double scale : {0x1p-20, 0x1p20}) ExpectSameBits(one.film, scaled(scale).film);
  }
}

// G12: paths that leave the interior without hitting its boundary end, and are counted.
TEST(SubsurfaceStability, G12OpenMeshIsCounted) {
  InteriorScene t({0.1, 0.2, -4}, {0, 0, 0}, 0.01f);
  t.ConstantEnvironment(Rgb::Gray(1));
  t.AddSubsurface(MeshShape{t.Quad({-1, -1, 0}, {-1, 1, 0}, {1, 1, 0}, {1, -1, 0})},
                  t.SubsurfaceOf(Rgb::Gray(1e-6f), Rgb::Gray(1e-6f), 0, 1.5f));
  const Rendered rendered = RenderCounted(t.scene, SquareSettings(4, 64, 5));
  EXPECT_GT(rendered.stats.broken_nestings, 900u);
  EXPECT_LT(rendered.mean.mean.g, 0.1f);  // The mirror reflection.
}

}  // namespace
}  // namespace sheaf::render
