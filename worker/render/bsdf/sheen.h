// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Sheen: fibers that stand up from a surface, as microfacets with a distribution of sines,
//   D(h) = (2 + 1/a) sin(h)^(1/a) / (2 pi),
// and a visibility that is smooth everywhere, 1 / (4 (o + i - o i)) for the cosines o and i. Its
// albedo exceeds 1 at grazing angles for small a; the whole is scaled so that its largest albedo is
// 1 at most. Sources: Estevez and Kulla 2017, "Production Friendly Microfacet Sheen BRDF"; Neubelt
// and Pettineo 2013 (visibility); KHR_materials_sheen (a = roughness^2).
#pragma once

#include <algorithm>
#include <cmath>

#include "common/math/elementary.h"
#include "common/math/vec.h"
#include "worker/render/bsdf/energy_table.h"

namespace sheaf::render {

// Fibers of less roughness are seen at grazing angles only, and their light is too rare to sample.
inline constexpr float kSheenRoughnessMin = 0.1f;

struct Sheen {
  float exponent = 0;  // 1 / a.
  float scale = 1;
  // Albedo over the cosine, of white sheen, and directions with density close to it.
  MuCurve albedo;
  LossLobe lobe;

  // Deterministic; some 10 ms. roughness in [0, 1].
  static Sheen Make(float roughness);
  // f * cos(wi). Requires: both z > 0.
  float Value(Vec3f wo, Vec3f wi) const {
    const Vec3f sum = wo + wi;
    const float across2 = sum.x * sum.x + sum.y * sum.y;
    const float sin2 = std::min(1.0f, across2 / (across2 + sum.z * sum.z));
    const float d = (2 + exponent) * Pow(sin2, 0.5f * exponent) * static_cast<float>(0.5 / kPi);
    return scale * d * wi.z / (4 * (wo.z + wi.z - wo.z * wi.z));
  }
};

}  // namespace sheaf::render
