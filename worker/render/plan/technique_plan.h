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
// Sets the plan's chain_shapes, and notes the reasons. Requires: the frame has chains.
void PlanChains(const SceneDescription& scene, RenderPlan* plan);

}  // namespace sheaf::render
