// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Every compiled variant that supports a scene's effects gives the same image as the generic
// variant, to the bit; and the plan chooses the smallest such variant.
#include <gtest/gtest.h>

#include <bit>
#include <functional>
#include <string>
#include <vector>

#include "tests/support/render_rows.h"
#include "tests/support/test_scene.h"
#include "worker/render/integrator/variants.h"

namespace sheaf::render {
namespace {

FilmTile RenderWith(const CompiledScene& scene, size_t variant) {
  return RenderRows(scene, RowFunctionOf(variant));
}

TestScene Base() {
  TestScene t({0, 1, -4}, {0, 0.5, 0}, 50);
  t.AddShape(MeshShape{t.Quad({-5, 0, -5}, {-5, 0, 5}, {5, 0, 5}, {5, 0, -5})},
             t.Diffuse({0.6f, 0.5f, 0.4f}));
  t.AddShape(MeshShape{t.Quad({-1, 3, -1}, {1, 3, -1}, {1, 3, 1}, {-1, 3, 1})}, t.Diffuse({}))
      .area_light = t.AreaLight(Rgb::Gray(5));
  return t;
}

// Adds a ball of fog, and the same fog around the camera.
void AddFog(TestScene& t, Rgb sigma_a, Rgb sigma_s) {
  MediumDescription fog;
  fog.sigma_a.rgb = sigma_a;
  fog.sigma_s.rgb = sigma_s;
  t.scene.media = {fog, fog};
  t.scene.media[1].g = 0.5f;
  t.scene.camera.medium = 0;
  t.AddShape(SphereShape{0.7f, -0.7f, 0.7f, 360}, t.AddMaterial(InterfaceMaterial{}),
             TranslateMatrix({0, 0.8, 0}))
      .media.inside = 1;
}

struct Case {
  std::string name;
  std::function<void(TestScene&)> add;
};

std::vector<Case> Cases() {
  const SphereShape ball{0.7f, -0.7f, 0.7f, 360};
  const Matrix4 up = TranslateMatrix({0, 0.7, 0});
  return {
      {"diffuse", [](TestScene&) {}},
      {"glass", [=](TestScene& t) { t.AddShape(ball, t.AddMaterial(DielectricMaterial{}), up); }},
      {"coat",
       [=](TestScene& t) {
         CoatedDiffuseMaterial coat;
         coat.roughness = {{0.3f, kNone}, {0.3f, kNone}, true};
         coat.reflectance.value.rgb = {0.3f, 0.2f, 0.1f};
         t.AddShape(ball, t.AddMaterial(coat), up);
       }},
      {"sky and lamp",
       [=](TestScene& t) {
         t.ConstantEnvironment({0.2f, 0.3f, 0.5f});
         PointLight light;
         light.intensity.rgb = Rgb::Gray(2);
         light.from = {1, 2, -1};
         t.scene.lights.push_back({light, {}, {}, {}});
         t.AddShape(ball, t.Diffuse(Rgb::Gray(0.5f)), up);
       }},
      {"lens",
       [=](TestScene& t) {
         t.scene.camera.lens_radius = 0.1f;
         t.scene.camera.focal_distance = 4;
       }},
      {"cut-out",
       [=](TestScene& t) {
         ShapeDescription& lace = t.AddShape(ball, t.Diffuse(Rgb::Gray(0.5f)), up);
         lace.has_alpha = true;
         lace.alpha.value = 0.5f;
       }},
      {"fog", [=](TestScene& t) { AddFog(t, Rgb::Gray(0.2f), Rgb::Gray(0.3f)); }},
      {"colored fog",
       [=](TestScene& t) {
         AddFog(t, {0.1f, 0.2f, 0.3f}, {0.5f, 0.3f, 0.2f});
       }},
  };
}

class EveryVariantTest : public ::testing::TestWithParam<ColorTransport> {};

TEST_P(EveryVariantTest, GivesTheGenericImage) {
  const std::vector<Variant> variants = AllVariants();
  for (const Case& c : Cases()) {
    TestScene t = Base();
    c.add(t);
    FrameSettings settings = SquareSettings(16, 16, 6);
    settings.color = GetParam();
    const CompiledScenePtr scene = Compile(t.scene, settings);
    const TraitBits traits = PlanOf(*scene).traits;
    const size_t generic_index = ChooseVariant(traits, true);
    const FilmTile generic = RenderWith(*scene, generic_index);
    EXPECT_GT(MeanOf(generic).mean.g, 0.01f) << c.name;
    const bool spectral = Has(traits, Trait::kSpectral);
    EXPECT_EQ(spectral, GetParam() == ColorTransport::kSpectral);
    size_t compared = 0;
    for (size_t i = 0; i < variants.size(); ++i) {
      const bool serves = (traits & ~variants[i].traits) == 0 &&
                          Has(variants[i].traits, Trait::kSpectral) == spectral;
      if (!serves || i == generic_index) continue;
      EXPECT_TRUE(RenderWith(*scene, i) == generic) << c.name << " by " << variants[i].name;
      ++compared;
    }
    EXPECT_GE(compared + (spectral ? 1 : 0), 1u) << c.name;
  }
}
INSTANTIATE_TEST_SUITE_P(Colors, EveryVariantTest,
                         ::testing::Values(ColorTransport::kRgb, ColorTransport::kSpectral),
                         [](const auto& color) { return ColorTransportName(color.param); });

TEST(VariantsTest, ForcedGenericVariantKeepsTheBits) {
  FrameSettings settings = SquareSettings(16, 16, 6);
  TestScene t = Base();
  const CompiledScenePtr planned = Compile(t.scene, settings);
  settings.force_generic_variant = true;
  const CompiledScenePtr forced = Compile(t.scene, settings);
  EXPECT_EQ(PlanOf(*planned).variant_name, "diffuse");
  EXPECT_EQ(PlanOf(*forced).variant_name, "generic");
  EXPECT_TRUE(RenderAll(*planned) == RenderAll(*forced));
}

TEST(VariantsTest, PlanNamesTheCause) {
  TestScene t = Base();
  t.scene.camera.lens_radius = 0.05f;
  t.scene.camera.location = {0, 12, 1};
  const RenderPlan plan = MakeRenderPlan(t.scene, SquareSettings(4, 1, 1));
  ASSERT_EQ(plan.effects.size(), 2u);
  EXPECT_EQ(plan.effects[0].name, "lens");
  EXPECT_EQ(plan.effects[0].cause, "test.pbrt:12:1: Camera \"float lensradius\" [0.05]");
  EXPECT_EQ(plan.effects[1].trait, Trait::kAreaLights);
  EXPECT_EQ(plan.unused.size(), static_cast<size_t>(kTraitCount - std::popcount(plan.traits)));
  const std::string text = FormatRenderPlan(plan);
  EXPECT_NE(text.find("variant: common+lens"), std::string::npos) << text;
  EXPECT_NE(text.find("lights: " + std::to_string(plan.light_count) + ", each weighted"),
            std::string::npos)
      << text;
}

TEST(VariantsTest, PlanNamesTechniquesAndTheirCause) {
  TestScene t = Base();
  FrameSettings settings = SquareSettings(4, 1, 1);
  EXPECT_TRUE(MakeRenderPlan(t.scene, settings).notes.empty());
  settings.techniques = TechniqueSet::kCameraAndLight;
  EXPECT_EQ(MakeRenderPlan(t.scene, settings).notes,
            std::vector<std::string>{"techniques: camera+light, requested"});
  t.scene.sampling.integrator = "bdpt";
  t.scene.sampling.integrator_location = {0, 3, 1};
  const RenderPlan plan = MakeRenderPlan(t.scene, settings);
  const std::string note = "techniques: camera+light, test.pbrt:3:1: Integrator \"bdpt\"";
  EXPECT_EQ(plan.notes, std::vector<std::string>{note});
  EXPECT_NE(FormatRenderPlan(plan).find("\n" + note + "\n"), std::string::npos);
}

TEST(VariantsTest, PlanSaysWhatGuidingNeeds) {
  const TestScene t = Base();
  FrameSettings settings = SquareSettings(4, 1, 1);
  for (const TechniqueSet techniques :
       {TechniqueSet::kCameraGuided, TechniqueSet::kCameraAndLightGuided}) {
    settings.techniques = techniques;
    const std::vector<std::string> notes = MakeRenderPlan(t.scene, settings).notes;
    ASSERT_EQ(notes.size(), 2u);
    EXPECT_EQ(notes[0], std::string("techniques: ") + techniques.Name() + ", requested");
    EXPECT_EQ(notes[1].rfind("guiding: ", 0), 0u) << notes[1];
    EXPECT_NE(notes[1].find("training"), std::string::npos) << notes[1];
  }
}

TEST(VariantsTest, LearnedLightsHaveVariantsOfTheirOwn) {
  const TestScene t = Base();
  FrameSettings settings = SquareSettings(4, 1, 1);
  settings.techniques = {Technique::kLearnedLights};
  const RenderPlan plan = MakeRenderPlan(t.scene, settings);
  EXPECT_TRUE(Has(plan.traits, Trait::kLearnedLights));
  EXPECT_EQ(plan.variant_name.rfind("learned lights", 0), 0u) << plan.variant_name;
  ASSERT_EQ(plan.notes.size(), 2u);
  EXPECT_EQ(plan.notes[1].rfind("learned lights: ", 0), 0u) << plan.notes[1];
  // Choices by product have the same variants, and do nothing beside light paths.
  settings.techniques = {Technique::kProduct};
  const RenderPlan product = MakeRenderPlan(t.scene, settings);
  EXPECT_EQ(product.variant_name, plan.variant_name);
  ASSERT_EQ(product.notes.size(), 2u);
  EXPECT_EQ(product.notes[1].rfind("product: rough metals, coats", 0), 0u) << product.notes[1];
  settings.techniques = {Technique::kProduct, Technique::kLightPaths};
  const RenderPlan beside = MakeRenderPlan(t.scene, settings);
  EXPECT_FALSE(Has(beside.traits, Trait::kLearnedLights));
  ASSERT_EQ(beside.notes.size(), 2u);
  EXPECT_EQ(beside.notes[1].rfind("product: off beside light paths", 0), 0u) << beside.notes[1];
  settings.techniques = {Technique::kLearnedLights};
  // Guided frames know lights in their own variants.
  settings.techniques = settings.techniques.With(Technique::kGuiding);
  EXPECT_FALSE(Has(MakeRenderPlan(t.scene, settings).traits, Trait::kLearnedLights));
}

}  // namespace
}  // namespace sheaf::render
