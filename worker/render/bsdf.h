// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Bsdf: how one surface point scatters light: a plain value made from a material at a hit, sampled
// and evaluated by functions templated over the traits a scene calls for, so that what a scene does
// not use is not compiled into its variant. Directions are unit vectors in the local shading frame
// with the normal at +z and point away from the surface; wo is where light goes (to the camera).
#pragma once

#include <cstdint>
#include <optional>

#include "common/math/vec.h"
#include "worker/render/render_plan.h"

namespace sheaf::render {

constexpr bool Has(uint32_t traits, Trait trait) {
  return (traits & static_cast<uint32_t>(trait)) != 0;
}
inline constexpr uint32_t kAllTraits = ~0u;

enum BsdfFlags : uint8_t {
  kBsdfSpecular = 1,      // Delta distribution: pdf has no meaning, no light sampling, no MIS.
  kBsdfTransmission = 2,  // wi is on the other side.
  kBsdfDiffuse = 4,
};

enum class BsdfKind : uint8_t {
  kBlack,            // Absorbs everything.
  kDiffuse,
  kConductor,        // Smooth or rough.
  kDielectric,       // Smooth or rough.
  kThinDielectric,
  kCoatedDiffuse,
  kInterface,        // Not there: rays pass straight through.
};

struct BsdfSample {
  Vec3f wi;
  Rgb weight;             // f * |cos wi| / pdf; for delta lobes the reflectance over its probability.
  float pdf = 0;          // Solid angle, of the whole Bsdf at wi.
  float eta_scale = 1;    // (eta_i/eta_o)^2 picked up by transmitted radiance; for roulette.
  uint8_t flags = 0;
};
struct BsdfValue {
  Rgb f_cos;      // f(wo, wi) * |cos wi|.
  float pdf = 0;  // Solid angle; 0 for delta lobes.
};

// Plain and small; fields are used by kind (see material.h, which makes it).
struct Bsdf {
  BsdfKind kind = BsdfKind::kBlack;
  bool specular = false;         // Delta lobes only: light sampling is skipped.
  float alpha_x = 0, alpha_y = 0;
  float eta = 1;                 // Relative index, inside over outside of the surface's +z side.
  Rgb color;                     // Reflectance (diffuse, coat base).
  Rgb eta_rgb, k_rgb;            // Conductors.
  const void* table = nullptr;   // Precomputed, per material (coats, energy compensation).
  Rgb albedo;                    // For the albedo channel.
};

// Radiance transport. None where the path ends (absorbed).
template <uint32_t kTraits>
std::optional<BsdfSample> SampleBsdf(const Bsdf& bsdf, Vec3f wo, float u_lobe, Vec2f u);
// Delta lobes evaluate to 0.
template <uint32_t kTraits>
BsdfValue EvalBsdf(const Bsdf& bsdf, Vec3f wo, Vec3f wi);

}  // namespace sheaf::render
