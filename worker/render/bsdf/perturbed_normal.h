// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PerturbedNormal: scattering about a perturbed shading normal (from a map, or from vertices)
// without losing energy below the true surface. Directions that a lobe about the perturbed normal
// sends below the surface, or so low that the bump would shadow them, are rotated back to
// directions that the true surface sees: no light leaks, none is lost, and there is no
// discontinuity at the horizon.
//
// The method has three parts. The normal is bent towards the surface's own, only as far as needed
// for a mirror reflection to point upwards (Keller et al. 2017, "The Iray Light Transport
// Simulation and Rendering System", sec. 4.3). The shadowed fraction of a direction is that of a
// microfacet surface whose roughness matches the tilt (Conty Estevez et al. 2019, "A
// Microfacet-Based Shadowing Function to Solve the Bump Terminator Problem", Ray Tracing Gems ch.
// 12), along the tilt. And as with the two-facet surface of Schuessler et al. 2017,
// "Microfacet-based Normal Mapping for Robust Monte Carlo Path Tracing", shadowed light continues:
// it is rotated about the axis of the tilt by an angle sampled for each path vertex. A rotation
// preserves solid angles, so a white surface stays white at any tilt, and the pdf of scattered
// directions is exact.
//
// Vertex normals describe a smooth surface, whose facets shadow nothing: only directions below the
// surface are rotated. See docs/adr/0013 and 0114.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "common/math/elementary.h"
#include "common/math/frame.h"
#include "worker/render/bsdf/bsdf_inl.h"

namespace sheaf::render {

// Minimum cosine between the perturbed and the surface normal; maps that exceed it are clamped.
inline constexpr float kPerturbedCosineMin = 0.05f;
// Vertex normals at a smaller angle to the surface lose at most 1/2000 of the light: (1 - cos) / 2.
inline constexpr float kTiltCosineMax = 0.999f;
// Minimum height of a mirror reflection above the horizon (cosine), and the fraction of the
// viewer's own height that limits it at grazing view.
inline constexpr float kReflectionHeightMin = 0.01f, kReflectionHeightFraction = 0.9f;

// Returns the unit normal nearest to n on the front of the surface. ng: unit.
inline Vec3f LiftNormal(Vec3f n, Vec3f ng) {
  const float height = Dot(n, ng);
  if (height >= kPerturbedCosineMin) return n;
  const Vec3f level = n - height * ng;
  const float length = Length(level);
  if (!(length > 0)) return ng;
  const float radius = std::sqrt(1 - kPerturbedCosineMin * kPerturbedCosineMin);
  return Normalize(level * (radius / length) + kPerturbedCosineMin * ng);
}

// Returns n or, if a mirror with that normal would reflect wo below the surface, the normal that
// reflects it just above the surface. ng, n, wo: unit, n in the hemisphere of ng; wo on either
// side. The result faces wo on the side that ng does.
inline Vec3f BendNormal(Vec3f n, Vec3f ng, Vec3f wo) {
  const float side = Dot(wo, ng) < 0 ? -1.0f : 1.0f;
  const Vec3f up = side * ng, m = side * n;
  const float height_o = Dot(wo, up), cos_o = Dot(wo, m);
  const float height_min = std::fmin(kReflectionHeightFraction * height_o, kReflectionHeightMin);
  const Vec3f r = 2 * cos_o * m - wo;
  const float height = Dot(r, up);
  if (cos_o > 0 && height >= height_min) return n;
  const Vec3f level = r - height * up;
  const float length = Length(level);
  if (!(length > 0)) return ng;
  const float radius = std::sqrt(1 - height_min * height_min);
  const Vec3f half = wo + level * (radius / length) + height_min * up;
  const float half_length = Length(half);
  // At grazing view against the tilt only the surface normal itself remains.
  if (!(half_length > 1e-3f)) return ng;
  return side * (half * (1 / half_length));
}

// The tilt at one path vertex, in its shading frame.
class PerturbedNormal {
 public:
  // Not tilted.
  PerturbedNormal() = default;
  enum class Source { kMap, kVertices };
  // ng_local: the surface's unit normal in the shading frame, above its horizon. u: uniform.
  PerturbedNormal(Source source, Vec3f ng_local, Vec2f u) : up_(ng_local) {
    const float sine_squared = up_.x * up_.x + up_.y * up_.y;
    if (!(sine_squared > 0)) return;
    const float sine = std::sqrt(sine_squared);
    // The part of the shading normal along the surface.
    axis_ = {-up_.z * up_.x / sine, -up_.z * up_.y / sine, sine};
    if (source == Source::kMap)
      alpha_squared_ = std::fmin(kAlphaFactor * sine_squared / (up_.z * up_.z), 1.0f);
    // A rotation by at least the tilt raises everything shadowed; by at most a right angle it sends
    // nothing below the far side.
    const float tilt = Atan2(sine, up_.z);
    const SinCosPair<float> rotation = SinCos(tilt + u.x * (static_cast<float>(kPi / 2) - tilt));
    sin_rotation_ = rotation.sin;
    cos_rotation_ = rotation.cos;
    mirrored_ = u.y < 0.5f;
    u_choice_ = std::fmin(mirrored_ ? 2 * u.y : 2 * u.y - 1, 0x1.fffffep-1f);
    active_ = true;
  }
  // Whether there is a tilt; otherwise the Bsdf applies unchanged.
  bool active() const { return active_; }

  // As EvalBsdf and SampleBsdf, over the hemispheres of the true surface. Requires: active(), wo on
  // the same side of both normals.
  template <TraitBits kTraits, typename Color>
  BsdfValueOf<Color> Eval(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi) const {
    BsdfValueOf<Color> value;
    const float sign = (Dot(wi, up_) > 0) == (wo.z > 0) ? SideOf(wo) : -SideOf(wo);
    const Vec3f q = sign * wi;
    if (!(Dot(q, up_) > 0)) return value;
    // The light that arrives unshadowed along this direction, and the light rotated to it.
    if (q.z > 0) Add<kTraits>(bsdf, wo, wi, Visible(q), &value);
    const Vec3f before = RotateBack(q);
    const float shadowed = before.z > 0 ? 1 - Visible(before) : 0;
    if (shadowed > 0) Add<kTraits>(bsdf, wo, sign * before, shadowed, &value);
    return value;
  }

  template <TraitBits kTraits, typename Color>
  std::optional<BsdfSampleOf<Color>> Sample(const BsdfOf<Color>& bsdf, Vec3f wo, float u_lobe,
                                            Vec2f u) const {
    std::optional<BsdfSampleOf<Color>> sample = SampleBsdf<kTraits>(bsdf, wo, u_lobe, u);
    if (!sample) return sample;
    const float sign = (sample->wi.z > 0) == (wo.z > 0) ? SideOf(wo) : -SideOf(wo);
    const Vec3f q = sign * sample->wi;
    // A mirror image stays sharp: only directions below the surface are rotated.
    const bool specular = (sample->flags & kBsdfSpecular) != 0;
    const float visible = specular ? (Dot(q, up_) > 0 ? 1.0f : 0.0f) : Visible(q);
    if (!(u_choice_ < visible)) {
      sample->wi = sign * Rotate(q);
      sample->flags |= kBsdfRotated;
    }
    if (!(sign * Dot(sample->wi, up_) > 0)) return std::nullopt;
    if (specular) return sample;
    const BsdfValueOf<Color> value = Eval<kTraits>(bsdf, wo, sample->wi);
    if (!(value.pdf > 0)) return std::nullopt;
    sample->weight = value.f_cos * (1 / value.pdf);
    sample->pdf = value.pdf;
    return sample;
  }

 private:
  // Conty Estevez et al. 2019, eq. 2.
  static constexpr float kAlphaFactor = 0.125f;

  static float SideOf(Vec3f wo) { return wo.z < 0 ? -1.0f : 1.0f; }

  template <TraitBits kTraits, typename Color>
  static void Add(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi, float fraction,
                  BsdfValueOf<Color>* value) {
    const BsdfValueOf<Color> part = EvalBsdf<kTraits>(bsdf, wo, wi);
    value->f_cos += part.f_cos * fraction;
    value->pdf += part.pdf * fraction;
  }

  // The directions q below are flipped to the front: above the shading normal's horizon before
  // shadowing, above the surface's in the end.

  // The unshadowed fraction of q. Directions on the side away from the tilt are not shadowed.
  float Visible(Vec3f q) const {
    const float height = Dot(q, up_), along = Dot(q, axis_);
    if (!(height > 0)) return 0;
    if (!(along > 0)) return 1;
    const float slope = along / height;
    return 2 / (1 + std::sqrt(1 + alpha_squared_ * slope * slope));
  }
  Vec3f Rotate(Vec3f q) const {
    const float along = Dot(q, axis_), height = Dot(q, up_);
    const float rotated = along * cos_rotation_ - height * sin_rotation_;
    return Moved(q, (mirrored_ ? -rotated : rotated) - along,
                 along * sin_rotation_ + height * cos_rotation_ - height);
  }
  Vec3f RotateBack(Vec3f q) const {
    const float along = Dot(q, axis_), height = Dot(q, up_);
    const float rotated = mirrored_ ? -along : along;
    return Moved(q, rotated * cos_rotation_ + height * sin_rotation_ - along,
                 height * cos_rotation_ - rotated * sin_rotation_ - height);
  }
  Vec3f Moved(Vec3f q, float along, float up) const { return q + along * axis_ + up * up_; }

  Vec3f up_{0, 0, 1};    // The surface's normal.
  Vec3f axis_{1, 0, 0};  // Along the surface, towards the shading normal.
  float alpha_squared_ = 0;
  float sin_rotation_ = 0, cos_rotation_ = 1;
  float u_choice_ = 0;
  bool mirrored_ = false, active_ = false;
};

}  // namespace sheaf::render
