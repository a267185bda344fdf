// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/plan/technique_plan.h"

#include "absl/strings/str_cat.h"
#include "common/scene/settings/path_shares.h"
#include "worker/render/plan/specular_surfaces.h"

namespace sheaf::render {
namespace {

// Sets the plan's chain_shapes, and notes the reasons.
void PlanChains(const SceneDescription& scene, RenderPlan* plan) {
  plan->chain_shapes = FindChainShapes(scene);
  plan->notes.insert(plan->notes.end(), plan->chain_shapes.notes.begin(),
                     plan->chain_shapes.notes.end());
}

}  // namespace

Variant VariantFor(TraitBits traits, const FrameSettings& settings) {
  const bool generic = settings.force_generic_variant;
  if (MutatesPaths(settings.techniques)) {
    return AllMutationVariants()[ChooseMutationVariant(traits, generic)];
  }
  if (HasOneTile(settings)) return AllEyeVariants()[ChooseEyeVariant(traits, generic)];
  if (HasChains(settings.techniques)) {
    return AllChainVariants()[ChooseChainVariant(traits, generic)];
  }
  if (HasLightPaths(settings.techniques)) {
    return AllLightPathVariants()[ChooseLightPathVariant(traits, generic)];
  }
  return AllVariants()[ChooseVariant(traits, generic)];
}

void PlanTechniques(const SceneDescription& scene, TechniqueSet techniques, RenderPlan* plan) {
  if (techniques == TechniqueSet::kCamera) return;
  const SamplingDescription& sampling = scene.sampling;
  const std::string cause = TechniquesOfIntegrator(sampling.integrator) != techniques
                                ? "requested"
                                : absl::StrCat(FormatLocation(scene, sampling.integrator_location),
                                               ": Integrator \"", sampling.integrator, "\"");
  plan->notes.push_back(absl::StrCat("techniques: ", techniques.Name(), ", ", cause));
  if (MergesLightPaths(techniques)) {
    plan->notes.emplace_back(
        MayHaveSpecularSurfaces(scene)
            ? "biased: light paths are merged with camera paths behind specular surfaces, within "
              "a radius that shrinks; merge.bias estimates the bias, and errors include it"
            : "merging: no surface of the scene is specular, so that no light path is merged");
  }
  if (HasChains(techniques)) PlanChains(scene, plan);
  if (GuidesEmission(techniques)) {
    plan->notes.emplace_back(
        "emission guiding: light paths begin where light reaches the picture, by a training");
  }
  if (LearnsLights(techniques)) {
    plan->notes.emplace_back("learned lights: regions sample those that a training saw there");
  }
  if (MutatesPaths(techniques)) {
    plan->notes.emplace_back(
        "mutations: samples 32 times as bright as their region start chains of 64 mutations");
  }
  if (techniques.Has(Technique::kProduct)) {
    plan->notes.emplace_back(
        ChoosesByProduct(techniques)
            ? "product: rough metals, coats and principled surfaces sample the lights that they "
              "reflect to the camera"
            : "product: off beside light paths, which would have to know the light samples of a "
              "camera path before they know from where the camera sees its vertex");
  }
  if (!IsGuided(techniques)) return;
  plan->notes.emplace_back(
      "guiding: camera paths also sample directions from the light that a training finds before "
      "the first sample");
  if (!SplitsPaths(techniques)) return;
  plan->notes.emplace_back(
      "splitting: several paths leave where the training found light that matters to the "
      "pixel and is uncertain");
}

}  // namespace sheaf::render
