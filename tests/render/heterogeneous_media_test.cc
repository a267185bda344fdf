// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Heterogeneous media: against homogeneous ones, in a white furnace, overlapping each other, and in
// color. The tolerance of means is ExpectMean's 5 standard errors, or 5 standard errors of the
// difference of two images.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <variant>
#include <vector>

#include "common/scene/spectrum/spectrum.h"
#include "gtest/gtest.h"
#include "tests/support/hard_case.h"
#include "tests/support/long_tests.h"
#include "tests/support/naive_media.h"
#include "tests/support/test_scene.h"
#include "worker/render/medium/color_parts.h"
#include "worker/render/medium/medium_set.h"
#include "worker/render/sampling/event_stream.h"

namespace sheaf::render {
namespace {

class SmokeScene : public TestScene {
 public:
  SmokeScene() : SmokeScene({0.2, 0.6, -2.5}, {0, 0, 0}, 30) {}
  SmokeScene(Vec3d eye, Vec3d at, float fov_degrees) : TestScene(eye, at, fov_degrees) {}

  // Adds a grid over the cube from -1 to 1: density times sigma.
  int32_t AddGrid(std::vector<float> density, Rgb sigma_a, Rgb sigma_s, float g = 0) {
    MediumDescription medium = Plain(sigma_a, sigma_s, g);
    const auto side = static_cast<int32_t>(std::lround(std::cbrt(density.size())));
    UniformGridMedium grid;
    grid.box = {{side, side, side}, {-1, -1, -1}, {1, 1, 1}};
    grid.density = std::move(density);
    medium.kind = std::move(grid);
    return Add(std::move(medium));
  }
  int32_t AddFog(Rgb sigma_a, Rgb sigma_s, float g = 0) { return Add(Plain(sigma_a, sigma_s, g)); }
  void Fill(float half_side, int32_t inside, int32_t outside = kNone) {
    const float h = half_side;
    AddShape(MeshShape{Box({-h, -h, -h}, {h, h, h})}, AddMaterial(InterfaceMaterial{})).media = {
        inside, outside};
  }

 private:
  MediumDescription Plain(Rgb sigma_a, Rgb sigma_s, float g) const {
    MediumDescription medium;
    medium.name = std::to_string(scene.media.size());
    medium.sigma_a.rgb = sigma_a;
    medium.sigma_s.rgb = sigma_s;
    medium.g = g;
    return medium;
  }
  int32_t Add(MediumDescription medium) {
    scene.media.push_back(std::move(medium));
    return static_cast<int32_t>(scene.media.size() - 1);
  }
};

std::vector<float> Lumps(int side) {
  EventStream random({1, 2, 3, 4});
  std::vector<float> values(static_cast<size_t>(side) * side * side);
  for (float& v : values) {
    const double u = random.Uniform();
    v = u < 0.4 ? 0.0f : static_cast<float>(4 * u * u * u);
  }
  return values;
}

TileMean Render(const SmokeScene& t, int samples, ColorTransport color = ColorTransport::kRgb) {
  FrameSettings settings = SquareSettings(16, samples, 64);
  settings.color = color;
  const CompiledScenePtr compiled = Compile(t.scene, settings);
  RenderStats stats;
  const FilmTile film = RenderAll(*compiled, &stats);
  EXPECT_EQ(stats.broken_nestings, 0u);
  EXPECT_EQ(stats.broken_majorants, 0u);
  return MeanOf(film);
}
void ExpectEqual(const TileMean& a, const TileMean& b) {
  for (size_t c = 0; c < 3; ++c) {
    const double error = std::hypot(a.standard_error[c], b.standard_error[c]);
    EXPECT_NEAR(a.mean[c], b.mean[c], 5 * error) << c;
    EXPECT_LT(error, 0.01 * std::max<double>(b.mean[c], 0.1)) << c;
  }
}

TEST(HeterogeneousMediaTest, ConstantGridEqualsAHomogeneousMedium) {
  for (const ColorTransport color : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
    SmokeScene grid, fog;
    const Rgb sigma_a{0.1f, 0.2f, 0.6f}, sigma_s{2.0f, 1.0f, 0.5f};
    for (SmokeScene* t : {&grid, &fog}) t->ConstantEnvironment({0.5f, 0.7f, 1});
    grid.Fill(0.8f, grid.AddGrid(std::vector<float>(40 * 40 * 40, 1.0f), sigma_a, sigma_s, 0.4f));
    fog.Fill(0.8f, fog.AddFog(sigma_a, sigma_s, 0.4f));
    const int samples = DrawCount(256, 2048);
    ExpectEqual(Render(grid, samples, color), Render(fog, samples, color));
  }
}

// V12: media without absorption return all incident light, whatever their density.
TEST(HeterogeneousMediaTest, V12WhiteFurnace) {
  for (const float g : {0.0f, 0.7f}) {
    SmokeScene t;
    t.ConstantEnvironment(Rgb::Gray(1));
    t.Fill(0.9f, t.AddGrid(Lumps(20), {}, {6, 3, 1}, g));
    FrameSettings settings = SquareSettings(16, DrawCount(128, 2048), 1 << 20);
    const CompiledScenePtr compiled = Compile(t.scene, settings);
    ExpectMean(MeanOf(RenderAll(*compiled)), Rgb::Gray(1));
  }
}

// Hardly any light comes straight to places deep in a cloud: few shadow rays begin there, and the
// mean stays that of the furnace.
TEST(HeterogeneousMediaTest, FewShadowRaysBeginDeepInACloud) {
  SmokeScene t;
  t.ConstantEnvironment(Rgb::Gray(1));
  std::vector<float> density = Lumps(20);
  for (float& v : density) v = 1 + 0.1f * v;
  t.Fill(0.9f, t.AddGrid(density, {}, Rgb::Gray(40)));
  const FrameSettings settings = SquareSettings(16, DrawCount(64, 1024), 1 << 20);
  const CompiledScenePtr compiled = Compile(t.scene, settings);
  RenderStats stats;
  ExpectMean(MeanOf(RenderAll(*compiled, &stats)), Rgb::Gray(1));
  // Each vertex has a ray of the path; in thin media it has one or two shadow rays besides.
  const uint64_t path_rays = stats.rays - stats.shadow_rays;
  EXPECT_LT(static_cast<double>(stats.shadow_rays), 0.6 * static_cast<double>(path_rays));
}

// Flights through a grid are sampled before surfaces are looked for: a ball in the grid still ends
// those that reach it, as in fog of the same density.
TEST(HeterogeneousMediaTest, SurfacesInAGridEndFlights) {
  for (const float sigma_s : {0.5f, 8.0f}) {
    SmokeScene grid, fog;
    for (SmokeScene* t : {&grid, &fog}) {
      t->ConstantEnvironment({0.5f, 0.7f, 1});
      t->AddShape(SphereShape{0.4f, -0.4f, 0.4f, 360}, t->Diffuse({0.1f, 0.2f, 0.3f}));
    }
    // Only a corner outside the box tells the grid from a constant one.
    std::vector<float> density(40 * 40 * 40, 1.0f);
    density[0] = 2;
    grid.Fill(0.8f, grid.AddGrid(density, {}, Rgb::Gray(sigma_s)));
    fog.Fill(0.8f, fog.AddFog({}, Rgb::Gray(sigma_s)));
    const int samples = DrawCount(256, 2048);
    ExpectEqual(Render(grid, samples), Render(fog, samples));
  }
}

// Two media in the same place act as one with the sum of their coefficients; also if one is
// homogeneous or one only absorbs.
TEST(HeterogeneousMediaTest, OverlappingMediaAddUp) {
  const std::vector<float> lumps = Lumps(20);
  std::vector<float> twice = lumps;
  for (float& v : twice) v *= 2;
  const Rgb sigma_a{0.1f, 0.4f, 0.2f}, sigma_s{1, 0.5f, 2};
  SmokeScene one, two;
  for (SmokeScene* t : {&one, &two}) t->ConstantEnvironment({0.5f, 0.7f, 1});
  one.Fill(0.7f, one.AddGrid(twice, sigma_a, sigma_s));
  two.Fill(0.7f, two.AddGrid(lumps, sigma_a, sigma_s));
  two.Fill(0.7001f, two.AddGrid(lumps, sigma_a, sigma_s));
  const int samples = DrawCount(128, 2048);
  ExpectEqual(Render(two, samples), Render(one, samples));
  // The constant grid, split into fog that scatters and grids that absorb.
  SmokeScene fog, parts;
  for (SmokeScene* t : {&fog, &parts}) t->ConstantEnvironment({0.5f, 0.7f, 1});
  const std::vector<float> even(40 * 40 * 40, 1.0f);
  fog.Fill(0.7f, fog.AddFog(sigma_a, sigma_s));
  parts.Fill(0.7f, parts.AddFog({}, sigma_s * 0.5f));
  parts.Fill(0.7001f, parts.AddGrid(even, sigma_a, {}));
  parts.Fill(0.7002f, parts.AddGrid(even, {}, sigma_s * 0.5f));
  ExpectEqual(Render(parts, samples), Render(fog, samples));
  // The maximum number of overlapping media: two grids in turn, and a fog as the last one.
  SmokeScene many;
  many.ConstantEnvironment({0.5f, 0.7f, 1});
  constexpr float kFraction = 1.0f / kMediaAtOnceMax;
  const int32_t kinds[] = {many.AddGrid(even, sigma_a * kFraction, sigma_s * kFraction),
                           many.AddGrid(even, sigma_a * kFraction, sigma_s * kFraction),
                           many.AddFog(sigma_a * kFraction, sigma_s * kFraction)};
  for (uint32_t i = 0; i < kMediaAtOnceMax; ++i) {
    many.Fill(0.7f + 1e-4f * static_cast<float>(i), kinds[i + 1 == kMediaAtOnceMax ? 2 : i % 2]);
  }
  ExpectEqual(Render(many, 2 * samples), Render(fog, 2 * samples));
}

// Rays in the plane through the edges of nested boxes enter and leave each box once, whichever of
// the two adjacent faces they hit.
TEST(HeterogeneousMediaTest, EdgesOfBoxesAreCrossedOnce) {
  SmokeScene t({3, 0.1, 3}, {0, 0.1, 0}, 1e-5f);
  t.ConstantEnvironment(Rgb::Gray(1));
  double depth = 0;  // Optical depth.
  for (uint32_t i = 0; i < kMediaAtOnceMax; ++i) {
    const float half_side = 0.5f + 0.01f * static_cast<float>(i);
    const float sigma_a = 0.01f;
    t.Fill(half_side, t.AddFog(Rgb::Gray(sigma_a), {}));
    depth += 2 * std::numbers::sqrt2 * double{half_side} * double{sigma_a};
  }
  const CompiledScenePtr compiled = Compile(t.scene, SquareSettings(16, 256, 8));
  RenderStats stats;
  const TileMean mean = MeanOf(RenderAll(*compiled, &stats));
  EXPECT_EQ(stats.broken_nestings, 0u);
  for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(mean.mean[c], std::exp(-depth), 1e-4);
}

// V10: grids that emit by a radiance, by scale factors or as black bodies equal homogeneous media
// of the same emission; alone, and attenuated by heterogeneous or homogeneous media.
TEST(HeterogeneousMediaTest, V10EmissiveGridsMatchHomogeneousMedia) {
  const std::vector<float> even(40 * 40 * 40, 1.0f);
  const Rgb sigma_a{0.1f, 0.2f, 0.6f}, sigma_s{0.6f, 0.3f, 0.2f};
  ColorSpec warm;
  warm.kind = ColorSpec::Kind::kBlackbody;
  warm.temperature_k = 3000;
  warm.rgb = SpectrumToRgb(warm, ColorRole::kIlluminant);
  // Scale to luminance 1; a grid's black bodies have a peak of 1.
  const auto luminance =
      static_cast<float>(SpectrumLuminance(warm) / EvaluateSpectrum(warm, 2.8977721e6 / 3000));
  const auto emissive = [](SmokeScene* t, int32_t index, const ColorSpec& color, float scale) {
    MediumDescription& medium = t->scene.media[static_cast<size_t>(index)];
    medium.emits = true;
    medium.radiance = color;
    medium.radiance_scale = scale;
    return index;
  };
  const auto grid_of = [](SmokeScene* t, int32_t index) -> UniformGridMedium& {
    return std::get<UniformGridMedium>(t->scene.media[static_cast<size_t>(index)].kind);
  };
  const int samples = DrawCount(128, 2048);
  for (const ColorTransport color : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
    SmokeScene fog, plain, factors, heat, dimmed, dims;
    fog.Fill(0.8f, emissive(&fog, fog.AddFog(sigma_a, sigma_s), warm, 0.5f));
    plain.Fill(0.8f, emissive(&plain, plain.AddGrid(even, sigma_a, sigma_s), warm, 0.5f));
    const int32_t scaled = factors.AddGrid(even, sigma_a, sigma_s);
    grid_of(&factors, scaled).radiance_scale = std::vector<float>(even.size(), 0.25f);
    factors.Fill(0.8f, emissive(&factors, scaled, warm, 2));
    const int32_t hot = heat.AddGrid(even, sigma_a, sigma_s);
    grid_of(&heat, hot).temperature_k = std::vector<float>(even.size(), 31);
    grid_of(&heat, hot).emission = {1, 100};
    heat.Fill(0.8f, emissive(&heat, hot, {}, 0.5f / luminance));
    // Fog has half of the absorption and emits twice as much; a grid has the other half.
    dimmed.Fill(0.8f, emissive(&dimmed, dimmed.AddFog(sigma_a * 0.5f, sigma_s * 0.5f), warm, 1));
    dimmed.Fill(0.8001f, dimmed.AddGrid(even, sigma_a * 0.5f, sigma_s * 0.5f));
    // The same with emission in the grid.
    dims.Fill(0.8f, dims.AddFog({}, sigma_s * 0.5f));
    dims.Fill(0.8001f, emissive(&dims, dims.AddGrid(even, sigma_a * 0.5f, {}), warm, 1));
    dims.Fill(0.8002f, dims.AddGrid(even, sigma_a * 0.5f, sigma_s * 0.5f));
    const TileMean expected = Render(fog, samples, color);
    const auto expect = [&](const char* name, const SmokeScene& t) {
      SCOPED_TRACE(name);
      ExpectEqual(Render(t, samples, color), expected);
    };
    expect("radiance", plain);
    expect("factors", factors);
    expect("temperatures", heat);
    expect("fog among grids", dimmed);
    expect("grid among others", dims);
  }
}

// V5: majorants that are too low are detected and raised, and the block is rendered again: the
// image equals that of correct majorants.
TEST(HeterogeneousMediaTest, V5LowBoundsAreRaised) {
  SmokeScene t;
  t.ConstantEnvironment({0.5f, 0.7f, 1});
  t.Fill(0.8f, t.AddGrid(Lumps(20), {0.1f, 0.2f, 0.6f}, {2, 1, 0.5f}, 0.4f));
  const FrameSettings settings = SquareSettings(16, 64, 64);
  const auto render = [&](float factor, RenderStats* stats) {
    TableFileSource files({});
    const auto scene = CompileScene(t.scene, settings, files, {}, {.majorant_factor = factor});
    EXPECT_TRUE(scene.ok()) << scene.status();
    return RenderAll(**scene, stats);
  };
  RenderStats as_found, halved, tiny;
  const FilmTile right = render(1, &as_found);
  EXPECT_EQ(as_found.raised_majorants, 0u);
  const FilmTile raised = render(0.5f, &halved);
  EXPECT_EQ(halved.raised_majorants, 1u);
  EXPECT_EQ(halved.broken_majorants, 0u);
  for (const FilmChannel c : {FilmChannel::kRedHi, FilmChannel::kGreenHi, FilmChannel::kWeight}) {
    EXPECT_TRUE(
        std::equal(right.channel(c), right.channel(c) + right.plane_size(), raised.channel(c)));
  }
  const FilmTile from_far = render(0x1p-12f, &tiny);
  EXPECT_GT(tiny.raised_majorants, 4u);
  EXPECT_EQ(tiny.broken_majorants, 0u);
  ExpectEqual(MeanOf(from_far), MeanOf(right));
  const TileMean expected = MeanOf(right), measured = MeanOf(from_far);
  // Extinction across the box with the collision rate of the densest lump's majorant.
  const float most = MaxComponent(Rgb{2.1f, 1.2f, 1.1f}) * 4 * 0x1p-12f;
  ExpectHardCase(
      {.row = "V5",
       .figure = "mean radiance of smoke whose bounds were 4096 times too low",
       .expected = expected.mean.g,
       .measured = measured.mean.g,
       .standard_error = std::hypot(expected.standard_error.g, measured.standard_error.g),
       .naive = 0.7f * naive::Transmittance(most, 1.6f),
       .naive_by = "bounds believed: the sky seen through the smoke"});
}

// V10: emissive fog overlapping a grid, with components that differ by a factor of a thousand: blue
// arrives only from close to the camera, red from the whole length.
TEST(HeterogeneousMediaTest, V10ChromaticEmissionBesideAGridAddsUp) {
  const Rgb sigma_a{0.01f, 0.3f, 10}, thin = sigma_a * 0.01f;
  ColorSpec white;
  white.rgb = Rgb::Gray(1);
  white.kind = ColorSpec::Kind::kRgb;
  SmokeScene together, apart;
  const int32_t all = together.AddFog(sigma_a + thin, {});
  together.Fill(0.8f, all);
  const int32_t emissive_index = apart.AddFog(sigma_a, {});
  apart.Fill(0.8f, emissive_index);
  apart.Fill(0.8001f, apart.AddGrid(std::vector<float>(40 * 40 * 40, 1.0f), thin, {}));
  const auto set_emission = [&](SmokeScene* t, int32_t index, Rgb radiance) {
    MediumDescription& medium = t->scene.media[static_cast<size_t>(index)];
    medium.emits = true;
    medium.radiance = white;
    medium.radiance.rgb = radiance;
  };
  set_emission(&apart, emissive_index, Rgb::Gray(1));
  set_emission(&together, all, Rgb::Gray(1 / 1.01f));
  const int samples = DrawCount(256, 2048);
  ExpectEqual(Render(apart, samples), Render(together, samples));
}

// Color grids: with one color everywhere they equal the homogeneous medium, also with emission;
// coefficients that pbrt-v4 allows to be omitted are 1.
TEST(HeterogeneousMediaTest, ConstantColorGridsAreHomogeneousMedia) {
  constexpr size_t kCells = 40 * 40 * 40;
  const Rgb sigma_a{0.3f, 0.5f, 1.2f}, sigma_s{1.2f, 0.8f, 0.4f}, emitted{0.5f, 0.2f, 1};
  const auto colors = [](SmokeScene* t, const RgbGridMedium& grid) {
    const int32_t index = t->AddGrid({1}, Rgb::Gray(1), Rgb::Gray(1), 0.3f);
    MediumDescription& medium = t->scene.media[static_cast<size_t>(index)];
    medium.kind = grid;
    medium.emits = !grid.radiance.empty();
    t->Fill(0.8f, index);
  };
  RgbGridMedium grid;
  grid.box = {{40, 40, 40}, {-1, -1, -1}, {1, 1, 1}};
  grid.sigma_a.assign(kCells, sigma_a);
  grid.sigma_s.assign(kCells, sigma_s);
  SmokeScene emissive, emissive_fog, plain, plain_fog;
  plain.ConstantEnvironment({0.5f, 0.7f, 1});
  plain_fog.ConstantEnvironment({0.5f, 0.7f, 1});
  grid.radiance.assign(kCells, emitted);
  colors(&emissive, grid);
  const int32_t fog = emissive_fog.AddFog(sigma_a, sigma_s, 0.3f);
  emissive_fog.scene.media[static_cast<size_t>(fog)].emits = true;
  emissive_fog.scene.media[static_cast<size_t>(fog)].radiance.rgb = emitted;
  emissive_fog.Fill(0.8f, fog);
  grid.radiance.clear();
  grid.sigma_a.clear();
  colors(&plain, grid);
  plain_fog.Fill(0.8f, plain_fog.AddFog(Rgb::Gray(1), sigma_s, 0.3f));
  const int samples = DrawCount(512, 2048);
  ExpectEqual(Render(emissive, samples), Render(emissive_fog, samples));
  ExpectEqual(Render(plain, samples), Render(plain_fog, samples));
}

// Color grids of grays equal scalar grids, also in spectral transport; grids that only scatter keep
// furnaces white, whatever their colors.
TEST(HeterogeneousMediaTest, ColorGridsAreTheSumOfTheirColors) {
  const std::vector<float> lumps = Lumps(20);
  RgbGridMedium grays;
  grays.box = {{20, 20, 20}, {-1, -1, -1}, {1, 1, 1}};
  for (const float v : lumps) {
    grays.sigma_a.push_back(Rgb::Gray(v));
    grays.sigma_s.push_back(Rgb::Gray(2 * v));
  }
  const int samples = DrawCount(256, 2048);
  for (const ColorTransport color : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
    SmokeScene numbers, colors, furnace;
    for (SmokeScene* t : {&numbers, &colors}) t->ConstantEnvironment({0.5f, 0.7f, 1});
    numbers.Fill(0.9f, numbers.AddGrid(lumps, Rgb::Gray(1), Rgb::Gray(2)));
    const int32_t grid = colors.AddGrid(lumps, {}, {});
    colors.scene.media[static_cast<size_t>(grid)].kind = grays;
    colors.Fill(0.9f, grid);
    ExpectEqual(Render(colors, samples, color), Render(numbers, samples, color));
    RgbGridMedium bright;
    bright.box = grays.box;
    bright.sigma_a.assign(lumps.size(), Rgb{});
    for (size_t i = 0; i < lumps.size(); ++i) {
      bright.sigma_s.push_back({3 * lumps[i], lumps[(7 * i + 1) % lumps.size()], 1});
    }
    furnace.ConstantEnvironment(Rgb::Gray(1));
    const int32_t all = furnace.AddGrid(lumps, {}, {}, 0.5f);
    furnace.scene.media[static_cast<size_t>(all)].kind = bright;
    furnace.Fill(0.9f, all);
    FrameSettings settings = SquareSettings(16, static_cast<uint64_t>(samples), 1 << 20);
    settings.color = color;
    ExpectMean(MeanOf(RenderAll(*Compile(furnace.scene, settings))), Rgb::Gray(1));
  }
}

// V3: a grid of zeros has no effect, also as a color grid.
TEST(HeterogeneousMediaTest, V3BlackColorGridsHaveNoEffect) {
  SmokeScene t;
  t.ConstantEnvironment(Rgb::Gray(1));
  const int32_t index = t.AddGrid({1}, Rgb::Gray(1), Rgb::Gray(1));
  RgbGridMedium grid;
  grid.box = {{2, 2, 2}, {-1, -1, -1}, {1, 1, 1}};
  grid.sigma_a.assign(8, Rgb{});
  grid.sigma_s.assign(8, Rgb{});
  t.scene.media[static_cast<size_t>(index)].kind = grid;
  t.Fill(0.8f, index);
  ExpectMean(MeanOf(RenderAll(*Compile(t.scene, SquareSettings(8, 16, 64)))), Rgb::Gray(1));
}

TEST(HeterogeneousMediaTest, ColorPartsAddUp) {
  const std::vector<Rgb> cells{{1, 2, 3}, {5, 5, 5}, {0, 0, 0}, {4, 0, 1}};
  const auto parts = SplitColors(cells);
  for (size_t i = 0; i < cells.size(); ++i) {
    Rgb sum;
    for (size_t k = 0; k < kColorPartCount; ++k) {
      if (parts[k].empty()) continue;
      sum += PartWeight<Rgb>(static_cast<ColorPart>(k), {}) * parts[k][i];
    }
    EXPECT_EQ(sum, cells[i]);
  }
  EXPECT_TRUE(SplitColors({Rgb::Gray(3)})[static_cast<size_t>(ColorPart::kRed)].empty());
  const Wavelengths wavelengths = Wavelengths::Sample(0.3f);
  const auto part_weight = [&](ColorPart part) { return PartWeight<Spectral>(part, wavelengths); };
  const Spectral all =
      part_weight(ColorPart::kRed) + part_weight(ColorPart::kGreen) + part_weight(ColorPart::kBlue);
  for (size_t i = 0; i < kWavelengthCount; ++i) {
    EXPECT_NEAR(all[i], 1, 1e-6);
    for (const ColorPart part : {ColorPart::kRed, ColorPart::kGreen, ColorPart::kBlue}) {
      EXPECT_GE(part_weight(part)[i], 0);
    }
  }
}

}  // namespace
}  // namespace sheaf::render
