// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Scenes that do not use a trait but run a variant that contains it, rendered by that variant and
// by the same variant with the trait compiled out: the images are equal.
// tests/cost/trait_cost_count.py runs these cases under callgrind and compares the instructions of
// RenderAsPlanned and RenderWithout.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "tests/support/render_rows.h"
#include "tests/support/test_scene.h"
#include "worker/render/integrator/variants.h"
#include "worker/render/traits/ablated_variants.h"

namespace sheaf::render {
namespace {

struct Ablated {
  std::string name;  // Name of the trait.
  TraitBits traits = 0;
  RenderRowFunction row = nullptr;
};
std::vector<Ablated> AllAblated() {
  return {
#define SHEAF_ABLATED_ENTRY(name, traits) {name, traits, &RenderRow<(traits)>},
      SHEAF_ABLATED_VARIANTS(SHEAF_ABLATED_ENTRY)
#undef SHEAF_ABLATED_ENTRY
  };
}

TestScene Floor() {
  TestScene t({0, 1, -4}, {0, 0.5, 0}, 50);
  t.AddShape(MeshShape{t.Quad({-5, 0, -5}, {-5, 0, 5}, {5, 0, 5}, {5, 0, -5})},
             t.Diffuse({0.6f, 0.5f, 0.4f}));
  return t;
}
void AddSceneLight(TestScene* t) {
  t->AddShape(MeshShape{t->Quad({-1, 3, -1}, {1, 3, -1}, {1, 3, 1}, {-1, 3, 1})}, t->Diffuse({}))
      .area_light = t->AreaLight(Rgb::Gray(5));
}
void AddPointLight(TestScene* t) {
  PointLight light;
  light.intensity.rgb = Rgb::Gray(5);
  light.from = {1, 3, -1};
  t->scene.lights.push_back({light, {}, {}, {}});
}
template <typename Shape, typename Material>
ShapeDescription& AddThing(TestScene* t, Shape shape, Material material) {
  return t->AddShape(shape, t->AddMaterial(material), TranslateMatrix({0, 0.7, 0}));
}
MeshShape Cube(TestScene* t) { return {t->Box({-0.6f, -0.6f, -0.6f}, {0.6f, 0.6f, 0.6f})}; }
const SphereShape kBall{0.7f, -0.7f, 0.7f, 360};

ConductorMaterial Metal() {
  ConductorMaterial metal;
  metal.roughness = {{0.3f, kNone}, {0.3f, kNone}, true};
  metal.has_reflectance = true;
  metal.reflectance.value.rgb = Rgb::Gray(0.8f);
  return metal;
}
void AddInstances(TestScene* t) {
  ObjectDefinition object;
  object.name = "cube";
  object.shapes = {static_cast<int32_t>(t->scene.shapes.size())};
  t->AddLooseShape(Cube(t), t->Diffuse(Rgb::Gray(0.5f)));
  t->scene.objects.push_back(object);
  for (int i = 0; i < 3; ++i) {
    ObjectInstance instance;
    instance.object = 0;
    instance.world_from_instance.start = instance.world_from_instance.end =
        TranslateMatrix({1.5 * i - 1.5, 0.7, 0});
    t->scene.instances.push_back(instance);
  }
}

struct Case {
  std::string trait;  // Not used by the scene.
  std::function<void(TestScene*)> add;
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.trait; }

// All of them run the variant "common".
std::vector<Case> Cases() {
  const auto glass_and_point_light = [](TestScene* t) {
    AddPointLight(t);
    AddThing(t, kBall, DielectricMaterial{});
  };
  return {
      {"textures", glass_and_point_light},
      {"delta lights",
       [](TestScene* t) {
         AddSceneLight(t);
         AddInstances(t);
       }},
      {"area lights", glass_and_point_light},
      {"transmission",
       [](TestScene* t) {
         AddSceneLight(t);
         AddInstances(t);
         AddThing(t, kBall, Metal());
       }},
      {"layered materials", glass_and_point_light},
      {"microfacets", glass_and_point_light},
      {"instances", glass_and_point_light},
      {"quadrics",
       [](TestScene* t) {
         AddSceneLight(t);
         AddInstances(t);
       }},
      {"vertex normals", glass_and_point_light},
  };
}

}  // namespace

// The profile refers to its name, so it must not be inlined.
[[gnu::noinline, gnu::noclone]] FilmTile RenderAsPlanned(const CompiledScene& scene) {
  return RenderRows(scene, RowFunctionOf(ChooseVariant(PlanOf(scene).traits, false)));
}
[[gnu::noinline, gnu::noclone]] FilmTile RenderWithout(const CompiledScene& scene,
                                                       RenderRowFunction row) {
  return RenderRows(scene, row);
}

namespace {

class CarriedTraitTest : public ::testing::TestWithParam<Case> {};

TEST_P(CarriedTraitTest, ChangesNoPixel) {
  const Case& c = GetParam();
  TestScene t = Floor();
  c.add(&t);
  const CompiledScenePtr scene = Compile(t.scene, SquareSettings(16, 16, 5));
  const std::vector<Ablated> all = AllAblated();
  const auto without = std::find_if(
      all.begin(), all.end(), [&](const Ablated& ablated) { return ablated.name == c.trait; });
  ASSERT_NE(without, all.end());
  const RenderPlan& plan = PlanOf(*scene);
  EXPECT_EQ(plan.variant_name, "common");
  EXPECT_NE(plan.variant_traits, without->traits) << "the variant does not carry " << c.trait;
  EXPECT_EQ(plan.variant_traits & without->traits, without->traits);
  EXPECT_EQ(plan.traits & ~without->traits, 0u) << "the scene uses " << c.trait;
  // Excludes one-time work from both counts: code loaded at the first call, and tables of the
  // lights.
  RenderRows(*scene, without->row);
  RenderRows(*scene, RowFunctionOf(ChooseVariant(plan.traits, false)));
  const FilmTile planned = RenderAsPlanned(*scene);
  EXPECT_TRUE(planned == RenderWithout(*scene, without->row));
  EXPECT_GT(MeanOf(planned).mean.g, 0.01f);
}

std::string TestNameOf(const std::string& trait) {
  std::string name = trait;
  std::replace(name.begin(), name.end(), ' ', '_');
  return name;
}
INSTANTIATE_TEST_SUITE_P(Traits, CarriedTraitTest, ::testing::ValuesIn(Cases()),
                         [](const auto& c) { return TestNameOf(c.param.trait); });

bool IsGeneric(const Variant& variant) {
  return variant.name == "generic" || variant.name == "spectral generic";
}

// The variant of a scene contains only traits that the scene needs or that are counted above,
// unless the scene needs a trait so rare that only the generic variants have it.
TEST(CarriedTraitTest, NoOtherTraitIsCarried) {
  TraitBits counted = 0;
  for (const Ablated& ablated : AllAblated()) {
    for (const Variant& variant : AllVariants()) {
      const TraitBits ablated_traits = variant.traits & ~ablated.traits;
      const bool is_one = (ablated_traits & (ablated_traits - 1)) == 0;
      if ((ablated.traits & ~variant.traits) == 0 && is_one) counted |= ablated_traits;
    }
  }
  TraitBits all = 0;
  for (const Variant& variant : AllVariants()) {
    if (!IsGeneric(variant)) all |= variant.traits;
  }
  const std::vector<Variant> variants = AllVariants();
  for (TraitBits traits = all; traits != 0; traits = (traits - 1) & all) {
    const Variant& variant = variants[ChooseVariant(traits, false)];
    if (IsGeneric(variant)) continue;
    // Scenes with media share a few variants, which no other scenes use.
    constexpr TraitBits kOfMedia = TraitSet(Trait::kMedia, Trait::kHeterogeneousMedia,
                                            Trait::kChromaticMedia, Trait::kEmissiveMedia);
    if (Has(variant.traits, Trait::kMedia)) {
      EXPECT_NE(traits & kOfMedia, 0u) << variant.name << " for " << traits;
      continue;
    }
    // So do scenes with principled materials.
    if (Has(variant.traits, Trait::kPrincipled)) {
      EXPECT_TRUE(Has(traits, Trait::kPrincipled)) << variant.name << " for " << traits;
      continue;
    }
    // So do guided frames, those that learn lights, and those that split them.
    constexpr TraitBits kRequested =
        TraitSet(Trait::kGuiding, Trait::kLightSplits, Trait::kLearnedLights);
    if ((variant.traits & kRequested) != 0) {
      EXPECT_EQ(variant.traits & kRequested & ~traits, 0u) << variant.name << " for " << traits;
      continue;
    }
    EXPECT_EQ(variant.traits & all & ~traits & ~counted, 0u) << variant.name << " for " << traits;
  }
}

}  // namespace
}  // namespace sheaf::render
