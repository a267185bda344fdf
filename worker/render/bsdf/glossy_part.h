// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GlossyPart: how much of a surface's reflection is one rough lobe about the mirror direction, for
// estimates that a few numbers must serve, such as sketches of lights (docs/adr/0240). It decides
// about noise alone.
#pragma once

#include "worker/render/bsdf/bsdf.h"

namespace sheaf::render {

struct GlossyPart {
  float alpha = 0;    // Width of the GGX lobe; 0: there is none.
  float glossy = 0;   // Its reflectance.
  float diffuse = 0;  // The reflectance of all else but delta lobes.
};

// Seen from wo, in the shading frame; wo.z > 0. The lobe that reflects more of two; the other
// counts as diffuse. There is none for glass, hair and measured materials. Requires: a variant that
// has the Bsdf's lobe.
template <typename Color>
GlossyPart GlossyPartOf(const BsdfOf<Color>& bsdf, Vec3f wo);

}  // namespace sheaf::render
