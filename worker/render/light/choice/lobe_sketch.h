// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LobeSketch: what the choice of lights knows of how a point on a surface reflects: a diffuse part
// and one glossy lobe. With it a light counts by its irradiance times the diffuse part, plus its
// irradiance from ahead times the lobe. A group of lights is a spherical Gaussian about its center;
// its variance, carried over to half vectors, widens the lobe, which is then evaluated once.
// Source: Tokuyoshi et al. 2024, "Hierarchical Light Sampling with Accurate Spherical Gaussian
// Lighting"; here for one roughness, and with the shape of GGX for the widened lobe.
#pragma once

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "common/math/lanes.h"
#include "common/math/vec.h"
#include "worker/render/light/choice/light_visibility_row.h"

namespace sheaf::render {

// The diffuse part counts as at least this fraction of all that is reflected, so that no light gets
// much less than its share by irradiance, however wrong the sketch is.
inline constexpr float kSketchDiffuseMin = 0.1f;

// Space: render. A sketch without a lobe changes nothing: choices go by irradiance alone.
struct LobeSketch {
  Vec3f wo{}, n{};  // Unit. wo: where light goes; n: of the surface, on the side of wo.
  float alpha_squared = 0;
  // The part that the lobe reflects, over the diffuse part and over 4 cos(wo, n), with shadowing.
  float gain = 0;

  // diffuse, glossy: reflectances, at least 0, of which one is positive. alpha: width of the GGX
  // lobe, in (0, 1]. Requires: Dot(wo, n) > 0.
  static LobeSketch Make(Vec3f wo, Vec3f n, float alpha, float diffuse, float glossy) {
    const float counted = std::max(diffuse, kSketchDiffuseMin * (diffuse + glossy));
    LobeSketch sketch{wo, n, alpha * alpha, 0};
    sketch.gain = glossy / (counted * sketch.TwiceShadowed());
    return sketch;
  }

  bool active() const { return gain > 0; }
  const LobeSketch* OrNull() const { return active() ? this : nullptr; }
  // The factor of irradiance that comes from all directions alike.
  float OfAllDirections() const { return 1 + gain * TwiceShadowed(); }
  // The lobe's reflection of lights in the directions `to`, over that of their irradiance from
  // ahead by the diffuse part. to: towards the lights, 1 / inverse_d long. variance: of their
  // directions, along an axis across them, in squared radians.
  Lanes LobeAt(Lanes to_x, Lanes to_y, Lanes to_z, Lanes inverse_d, Lanes variance) const;

 private:
  // 2 cos_o / G1(cos_o). Source: Heitz 2014, "Understanding the Masking-Shadowing Function".
  float TwiceShadowed() const {
    const float cosine = Dot(wo, n);
    return 2 * (cosine + std::sqrt(alpha_squared + (1 - alpha_squared) * cosine * cosine));
  }
};

inline Lanes LobeSketch::LobeAt(Lanes to_x, Lanes to_y, Lanes to_z, Lanes inverse_d,
                                Lanes variance) const {
  // Keeps directions opposite to wo finite.
  constexpr float kHalfSquaredMin = 0x1p-20f;
  const Lanes cos_light = (n.x * to_x + n.y * to_y + n.z * to_z) * inverse_d;
  const Lanes cos_between = (wo.x * to_x + wo.y * to_y + wo.z * to_z) * inverse_d;
  // The squared length of the half vector, and its squared cosine with the normal.
  const Lanes half_squared = Max(All(kHalfSquaredMin), 2 + 2 * cos_between);
  const Lanes rise = Max(Lanes{}, Dot(wo, n) + Max(Lanes{}, cos_light));
  const Lanes cos_squared = Min(All(1), rise * rise / half_squared);
  // A solid angle of directions is 4 cos(wo, h) times that of the half vectors, and the squared
  // width of a lobe is twice its variance.
  const Lanes widened = Min(All(1), alpha_squared + variance / Sqrt(half_squared));
  const Lanes falloff = 1 - cos_squared * (1 - widened);
  return gain * widened / (falloff * falloff);
}

// A row, and the sketch of the point; null: choices go by the row alone, to the same bits.
struct ProductRow : LightVisibilityRow {
  const LobeSketch* sketch = nullptr;
};
template <typename Row>
inline constexpr bool kHasSketch = std::is_same_v<Row, ProductRow>;

}  // namespace sheaf::render
