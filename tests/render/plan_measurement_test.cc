// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Ablations: every effect can be ablated while the others stay; measurements match known answers.
// The plan's bound of the depth changes no bit.
#include "worker/render/ablation/plan_measurement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <string_view>

#include "tests/support/test_scene.h"
#include "worker/render/ablation/ablate.h"
#include "worker/render/traits/trait_set.h"

namespace sheaf::render {
namespace {

const SphereShape kBall{0.5f, -0.5f, 0.5f, 360};

// All effects at once except wavelengths.
TestScene Everything() {
  TestScene t({0, 1, -4}, {0, 0.5, 0}, 50);
  t.scene.camera.shutter_close = 1;
  t.scene.camera.lens_radius = 0.05f;
  t.scene.camera.focal_distance = 4;
  TextureDescription checks;
  checks.name = "checks";
  checks.is_color = true;
  CheckerboardTexture board;
  board.color[0].value.rgb = {0.8f, 0.4f, 0.2f};
  board.color[1].value.rgb = {0.2f, 0.2f, 0.6f};
  checks.texture = board;
  t.scene.textures.push_back(checks);
  DiffuseMaterial floor;
  floor.reflectance.texture = 0;
  t.AddShape(MeshShape{t.Quad({-5, 0, -5}, {-5, 0, 5}, {5, 0, 5}, {5, 0, -5})},
             t.AddMaterial(floor));
  t.ConstantEnvironment({0.2f, 0.3f, 0.5f});
  PointLight light;
  light.intensity.rgb = Rgb::Gray(2);
  light.from = {1, 2, -1};
  t.scene.lights.push_back({light, {}, {}, {}});
  t.AddShape(MeshShape{t.Quad({-1, 3, -1}, {1, 3, -1}, {1, 3, 1}, {-1, 3, 1})}, t.Diffuse({}))
      .area_light = t.AreaLight(Rgb::Gray(5));
  ConductorMaterial metal;
  metal.eta.value.rgb = {0.2f, 0.9f, 1.1f};
  metal.k.value.rgb = {3.9f, 2.5f, 1.9f};
  CoatedConductorMaterial coated;
  coated.conductor = metal;
  MixMaterial mix;
  mix.material[0] = t.AddMaterial(DielectricMaterial{});
  mix.material[1] = t.AddMaterial(CoatedDiffuseMaterial{});
  mix.amount.value = 0.5f;
  int i = 0;
  for (const int32_t material :
       {t.AddMaterial(metal), t.AddMaterial(coated), t.AddMaterial(mix),
        t.AddMaterial(InterfaceMaterial{}), t.AddMaterial(ThinDielectricMaterial{}),
        t.AddMaterial(DiffuseTransmissionMaterial{})}) {
    t.AddShape(kBall, material, TranslateMatrix({0.6 * i - 1.5, 0.5, 0.2 * i}));
    ++i;
  }
  t.scene.shapes.back().world_from_object.end = TranslateMatrix({2, 0.8, 1});
  t.scene.shapes.back().has_alpha = true;
  t.scene.shapes.back().alpha.value = 0.5f;
  const int32_t tilted = t.Quad({-1, 0.1f, 1}, {1, 0.1f, 1}, {1, 0.1f, 2}, {-1, 0.1f, 2});
  t.scene.meshes.back().normals.assign(4, Normalize(Vec3f{0.5f, 1, 0}));
  t.AddShape(MeshShape{tilted}, t.Diffuse(Rgb::Gray(0.5f))).invisible = BitOf(RayKind::kGlossy);
  ObjectDefinition object;
  object.name = "ball";
  object.shapes = {static_cast<int32_t>(t.scene.shapes.size())};
  t.AddLooseShape(kBall, t.Diffuse(Rgb::Gray(0.5f)));
  t.scene.objects.push_back(object);
  ObjectInstance instance;
  instance.object = 0;
  t.scene.instances.push_back(instance);
  return t;
}

TEST(AblateTest, EveryEffectCanBeAblatedAlone) {
  const TestScene t = Everything();
  FrameSettings settings = SquareSettings(8, 1, 3);
  settings.color = ColorTransport::kSpectral;
  const RenderPlan whole = MakeRenderPlan(t.scene, settings);
  EXPECT_GE(whole.effects.size(), 13u);
  TableFileSource files({});
  for (const PlannedEffect& effect : whole.effects) {
    const absl::StatusOr<AblatedScene> without = Ablate(effect.trait, t.scene, settings, files);
    ASSERT_TRUE(without.ok()) << effect.name << ": " << without.status();
    EXPECT_FALSE(without->how.empty()) << effect.name;
    const TraitBits rest = MakeRenderPlan(without->scene, without->settings).traits;
    TraitBits allowed = static_cast<TraitBits>(effect.trait);
    // Coats use microfacets too.
    if (effect.trait == Trait::kMicrofacet) allowed |= TraitSet(Trait::kLayered);
    EXPECT_EQ(rest | allowed, whole.traits) << effect.name;
    EXPECT_EQ(rest & static_cast<TraitBits>(effect.trait), 0u) << effect.name;
    EXPECT_NE(Compile(without->scene, without->settings), nullptr) << effect.name;
  }
}

// Deformation is a kind of motion: without motion the shape is fixed, without deformation the other
// motion remains.
TEST(AblateTest, DeformationIsAblatedAlone) {
  TestScene t = Everything();
  TriangleMesh& floor = t.scene.meshes[0];
  floor.steps.push_back({floor.positions, {}});
  floor.steps[0].positions[0].y = 0.5f;
  const FrameSettings settings = SquareSettings(8, 1, 3);
  const TraitBits whole = MakeRenderPlan(t.scene, settings).traits;
  EXPECT_TRUE(Has(whole, Trait::kDeformation));
  TableFileSource files({});
  const auto rest = [&](Trait trait) {
    const absl::StatusOr<AblatedScene> without = Ablate(trait, t.scene, settings, files);
    EXPECT_TRUE(without.ok()) << without.status();
    return MakeRenderPlan(without->scene, without->settings).traits;
  };
  EXPECT_EQ(rest(Trait::kDeformation), whole & ~TraitSet(Trait::kDeformation));
  EXPECT_EQ(rest(Trait::kMotion), whole & ~TraitSet(Trait::kMotion, Trait::kDeformation));
}

TEST(AblateTest, TexturesBecomeTheirMean) {
  TableFileSource files({});
  const auto without = Ablate(Trait::kTextures, Everything().scene, SquareSettings(8, 1, 3), files);
  ASSERT_TRUE(without.ok());
  const auto& floor = std::get<DiffuseMaterial>(without->scene.materials[0].material);
  EXPECT_EQ(floor.reflectance.texture, kNone);
  const Rgb mean = floor.reflectance.value.rgb;
  EXPECT_NEAR(mean.r, 0.5f, 1e-4f);
  EXPECT_NEAR(mean.g, 0.3f, 1e-4f);
  EXPECT_NEAR(mean.b, 0.4f, 1e-4f);
}

TEST(AblateTest, CurvedShapesAsTrianglesGiveTheSameImage) {
  const TestScene t = LitRoom(1);
  const FrameSettings settings = SquareSettings(24, 64, 4);
  TableFileSource files({});
  const auto without = Ablate(Trait::kQuadrics, t.scene, settings, files);
  ASSERT_TRUE(without.ok());
  const TileMean curved = RenderMean(t.scene, settings);
  const TileMean plain = RenderMean(without->scene, settings);
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(plain.mean[c] / curved.mean[c], 1, 0.01) << "channel " << c;
  }
}

const EffectMeasurement& Find(const PlanMeasurement& measurement, std::string_view name) {
  const auto found = std::find_if(measurement.effects.begin(), measurement.effects.end(),
                                  [&](const auto& effect) { return effect.name == name; });
  EXPECT_NE(found, measurement.effects.end()) << name;
  return *found;
}

TEST(PlanMeasurementTest, KnownLossesAreMeasured) {
  // The sky is the only light, so nothing is left without it.
  TestScene t({0, 1, -4}, {0, 0.5, 0}, 50);
  t.AddShape(MeshShape{t.Quad({-5, 0, -5}, {-5, 0, 5}, {5, 0, 5}, {5, 0, -5})},
             t.Diffuse(Rgb::Gray(0.5f)));
  t.ConstantEnvironment(Rgb::Gray(1));
  TableFileSource files({});
  const auto measured =
      MeasurePlan(t.scene, SquareSettings(32, 16, 5), files, kMeasureSecondsMin * 5);
  ASSERT_TRUE(measured.ok()) << measured.status();
  ASSERT_EQ(measured->effects.size(), 3u);
  EXPECT_EQ(measured->effects[0].name, "environment");
  const EffectMeasurement& sky = Find(*measured, "environment");
  EXPECT_EQ(sky.problem, "");
  EXPECT_NEAR(sky.mean_change.value, -1, 1e-9);
  EXPECT_GT(sky.relative_mse, 0.5);
  EXPECT_GT(sky.time_ratio.value, 1);
  // A single plane cannot scatter light twice.
  const EffectMeasurement& indirect = Find(*measured, "indirect light");
  EXPECT_EQ(indirect.mean_change.value, 0);
  EXPECT_EQ(indirect.relative_mse, 0);
}

TEST(PlanMeasurementTest, EffectsWithoutTimeAreMarked) {
  const TestScene t = Everything();
  TableFileSource files({});
  const auto measured = MeasurePlan(t.scene, SquareSettings(64, 16, 5), files, kMeasureSecondsMin);
  ASSERT_TRUE(measured.ok()) << measured.status();
  EXPECT_EQ(measured->effects.size(), 14u + 2u);
  for (const EffectMeasurement& effect : measured->effects) {
    EXPECT_TRUE(effect.samples >= 2 || !effect.problem.empty()) << effect.name;
  }
  EXPECT_NE(FormatPlanMeasurement(*measured).find("relMSE"), std::string::npos);
  EXPECT_FALSE(MeasurePlan(t.scene, SquareSettings(8, 1, 1), files, 0).ok());
  EXPECT_FALSE(MeasurePlan(t.scene, SquareSettings(8, 1, 1), files, std::nan("")).ok());
}

TEST(PlanMeasurementTest, InsignificantValuesAreNotPrinted) {
  PlanMeasurement measurement;
  EffectMeasurement light;
  light.name = "lamp";
  light.time_ratio = {1.81, 0.02};
  light.variance_ratio = std::numeric_limits<double>::infinity();
  light.relative_mse = -0.0016;
  EffectMeasurement choice;
  choice.name = "choice";
  choice.time_ratio = {0.4, 0.01};
  EffectMeasurement lens;
  lens.name = "lens";
  lens.time_ratio = {1.01, 0.02};
  measurement.effects = {light, choice, lens};
  const std::string text = FormatPlanMeasurement(measurement);
  EXPECT_EQ(text.find("inf"), std::string::npos) << text;
  EXPECT_EQ(text.find("-0.0016"), std::string::npos) << text;
  EXPECT_NE(text.find("44.8 %"), std::string::npos) << text;
  EXPECT_NE(text.find("saves 60.0 %"), std::string::npos) << text;
  EXPECT_NE(text.find("lens       none seen"), std::string::npos) << text;
}

TEST(RenderPlanTest, EveryEffectStatesItsCost) {
  FrameSettings settings = SquareSettings(8, 1, 3);
  settings.color = ColorTransport::kSpectral;
  const RenderPlan plan = MakeRenderPlan(Everything().scene, settings);
  for (const PlannedEffect& effect : plan.effects) {
    EXPECT_GT(effect.expected_time_ratio, 0.2) << effect.name;
    EXPECT_LT(effect.expected_time_ratio, 20) << effect.name;
  }
  // A number from another scene would be taken for one of this scene.
  EXPECT_EQ(FormatRenderPlan(plan).find(" %  "), std::string::npos);
  EXPECT_NE(FormatRenderPlan(plan).find("--measure measures it in this one\n"), std::string::npos);
}

// Black surfaces end paths, whether seen directly or lit; a single gray material removes the bound.
TEST(RenderPlanTest, DepthIsBoundedWithoutScattering) {
  TestScene t({0, 1, -4}, {0, 0.5, 0}, 50);
  t.AddShape(MeshShape{t.Quad({-5, 0, -5}, {-5, 0, 5}, {5, 0, 5}, {5, 0, -5})}, t.Diffuse({}));
  t.AddShape(kBall, t.Diffuse({}), TranslateMatrix({0, 0.5, 0})).area_light =
      t.AreaLight({3, 2, 1});
  t.ConstantEnvironment({0.2f, 0.3f, 0.5f});
  const FrameSettings settings = SquareSettings(16, 16, 5);
  const RenderPlan plan = MakeRenderPlan(t.scene, settings);
  EXPECT_EQ(plan.max_depth, 0);
  EXPECT_EQ(plan.depth_cause, "every surface is black");
  // A gray object outside the view removes the bound.
  TestScene seen = t;
  seen.AddShape(kBall, seen.Diffuse(Rgb::Gray(0.5f)), TranslateMatrix({0, 0, -100}));
  EXPECT_EQ(MakeRenderPlan(seen.scene, settings).max_depth, 5);
  EXPECT_TRUE(RenderAll(*Compile(t.scene, settings)) == RenderAll(*Compile(seen.scene, settings)));
}

TEST(RenderPlanTest, DepthIsBoundedWithoutLight) {
  TestScene t({0, 1, -4}, {0, 0.5, 0}, 50);
  t.AddShape(kBall, t.Diffuse(Rgb::Gray(0.5f)), TranslateMatrix({0, 0.5, 0}));
  const FrameSettings settings = SquareSettings(8, 4, 5);
  EXPECT_EQ(MakeRenderPlan(t.scene, settings).max_depth, 0);
  const TileMean mean = RenderMean(t.scene, settings);
  EXPECT_EQ(mean.mean, Rgb());
  EXPECT_EQ(mean.rays, 8u * 8u * 4u);
}

}  // namespace
}  // namespace sheaf::render
