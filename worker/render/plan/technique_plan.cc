// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/plan/technique_plan.h"

#include "common/scene/settings/path_shares.h"

namespace sheaf::render {

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

void PlanChains(const SceneDescription& scene, RenderPlan* plan) {
  plan->chain_shapes = FindChainShapes(scene);
  plan->notes.insert(plan->notes.end(), plan->chain_shapes.notes.begin(),
                     plan->chain_shapes.notes.end());
}

}  // namespace sheaf::render
