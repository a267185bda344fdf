// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The parts of a plan that follow from the techniques of the frame.
#pragma once

#include <cstdint>

#include "worker/render/plan/render_plan.h"
#include "worker/render/traits/variant_choice.h"

namespace sheaf::render {

// The compiled variant that renders the traits.
Variant VariantFor(TraitBits traits, const FrameSettings& settings);
// Notes what the techniques do in this scene and why; with chains, sets the plan's chain_shapes.
void PlanTechniques(const SceneDescription& scene, TechniqueSet techniques, RenderPlan* plan);

}  // namespace sheaf::render
