// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Sketches of what a vertex reflects, by which it chooses lights in frames with
// Technique::kProduct. docs/adr/0240.
#pragma once

#include "common/math/frame.h"
#include "common/scene/settings/techniques.h"
#include "worker/render/bsdf/bsdf.h"
#include "worker/render/bsdf/glossy_part.h"
#include "worker/render/integrator/context.h"
#include "worker/render/light/choice/lobe_sketch.h"

namespace sheaf::render {

// Without a lobe where GlossyPartOf finds none. wo: in the shading frame.
template <typename Color>
LobeSketch SketchOf(const BsdfOf<Color>& bsdf, Vec3f wo, const Frame& shading) {
  if (bsdf.specular || !(wo.z > 0)) return {};
  const GlossyPart part = GlossyPartOf(bsdf, wo);
  if (!(part.glossy > 0)) return {};
  return LobeSketch::Make(shading.ToWorld(wo), shading.n, part.alpha, part.diffuse, part.glossy);
}

// The sketch where the frame chooses lights by it. Not in trainings, whose rows are of choices
// without one.
template <typename C>
LobeSketch SketchAt(const Context<C>& c, const BsdfOf<typename C::Color>& bsdf, Vec3f wo,
                    const Frame& shading) {
  static_assert(C::kProduct);
  if (!ChoosesByProduct(c.scene.settings.techniques) || c.guiding.training != nullptr) return {};
  return SketchOf(bsdf, wo, shading);
}

}  // namespace sheaf::render
