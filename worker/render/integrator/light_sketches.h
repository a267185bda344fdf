// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Sketches of what a vertex reflects, by which it chooses lights in frames with
// Technique::kProduct. docs/adr/0240.
#pragma once

#include <algorithm>

#include "common/math/frame.h"
#include "common/scene/settings/techniques.h"
#include "worker/render/bsdf/bsdf.h"
#include "worker/render/bsdf/energy_table.h"
#include "worker/render/bsdf/fresnel.h"
#include "worker/render/bsdf/microfacet.h"
#include "worker/render/integrator/context.h"
#include "worker/render/light/choice/lobe_sketch.h"

namespace sheaf::render {

// Without a lobe for materials other than rough conductors and coated diffuse ones with a rough
// coat. wo: in the shading frame.
template <typename Color>
LobeSketch SketchOf(const BsdfOf<Color>& bsdf, Vec3f wo, const Frame& shading) {
  const Ggx ggx{bsdf.alpha_x, bsdf.alpha_y};
  if (bsdf.specular || ggx.IsSmooth() || !(wo.z > 0)) return {};
  float diffuse = 0, glossy = 1;
  if (bsdf.kind == BsdfKind::kCoatedDiffuse) {
    glossy = FresnelDielectric(std::min(1.0f, wo.z), bsdf.eta).reflectance;
    diffuse = (1 - glossy) * static_cast<float>(MeanRadiance(bsdf.color));
  } else if (bsdf.kind != BsdfKind::kConductor) {
    return {};
  }
  const float alpha = std::clamp(EquivalentAlpha(ggx), kSmoothAlpha, 1.0f);
  return LobeSketch::Make(shading.ToWorld(wo), shading.n, alpha, diffuse, glossy);
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
