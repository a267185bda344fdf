// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Bsdf: how one surface point scatters light: a plain value made from a material at a hit, sampled
// and evaluated by functions templated over the traits a scene calls for, so that what a scene does
// not use is not compiled into its variant. Directions are unit vectors in the local shading frame
// with the normal at +z and point away from the surface; wo is where light goes (to the camera).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "common/math/vec.h"
#include "worker/render/bsdf/coat_table.h"
#include "worker/render/bsdf/conductor_coat_table.h"
#include "worker/render/bsdf/energy_table.h"
#include "worker/render/color/wavelengths.h"
#include "worker/render/traits/trait_set.h"

namespace sheaf::render {

class MeasuredBrdf;
struct PrincipledSurface;

enum BsdfFlags : uint8_t {
  kBsdfSpecular = 1,      // Delta distribution: pdf has no meaning, no light sampling, no MIS.
  kBsdfTransmission = 2,  // wi is on the other side; hair: wherever it is.
  kBsdfDiffuse = 4,
  kBsdfRotated = 8,  // wi is not the lobe's own: PerturbedNormal.
};

// One for each lobe (lobes.h), which says what it is, and one for none.
enum class BsdfKind : uint8_t {
  kBlack,  // Absorbs everything.
  kDiffuse,
  kConductor,   // Smooth or rough.
  kDielectric,  // Smooth or rough.
  kThinDielectric,
  kDiffuseTransmission,
  kCoatedDiffuse,
  kCoatedConductor,
  kHair,
  kMeasured,
  kPrincipled,
  kInterface,  // Not there: rays pass straight through.
};

// Color: Rgb, or Spectral at the wavelengths of the path.
template <typename Color>
struct BsdfSampleOf {
  Vec3f wi{};
  Color weight{};       // f * |cos wi| / pdf; for delta lobes the reflectance over its probability.
  float pdf = 0;        // Solid angle, of the whole Bsdf at wi.
  float eta_scale = 1;  // (eta_i/eta_o)^2 picked up by transmitted radiance; for roulette.
  uint8_t flags = 0;
};
template <typename Color>
struct BsdfValueOf {
  Color f_cos{};  // f(wo, wi) * |cos wi|.
  float pdf = 0;  // Solid angle; 0 for delta lobes.
};

// Where a ray meets a fibre, and how the fibre's scales stand.
struct HairFiber {
  float offset;    // Across the fibre, [-1, 1].
  float sin_tilt;  // Sine of the angle of the scales.
};

// The parts of a principled surface: fractions, in [0, 1].
struct PrincipledBase {
  float metallic, transmission;
};
struct PrincipledTop {
  float coat, specular;
};

// The unit normal of a coat, in the shading frame of what it covers, by its x and y in 1/32767.
struct CoatTilt {
  int16_t x = 0, y = 0;

  bool IsFlat() const { return x == 0 && y == 0; }
  // n: unit, above the frame's horizon.
  static CoatTilt Of(Vec3f n) {
    return {static_cast<int16_t>(n.x * 32767), static_cast<int16_t>(n.y * 32767)};
  }
  Vec3f Normal() const {
    const float nx = static_cast<float>(x) / 32767, ny = static_cast<float>(y) / 32767;
    return {nx, ny, std::sqrt(std::max(0.0f, 1 - nx * nx - ny * ny))};
  }
};

// Plain and small; fields are used by kind (material.h makes it). Row pointers belong to the
// material table; where blend > 0 the row that follows in memory counts with that weight.
struct BsdfShape {
  BsdfKind kind = BsdfKind::kBlack;
  bool specular = false;   // Delta lobes only: light sampling is skipped.
  bool disperses = false;  // eta is that of the hero: the other wavelengths end here.
  // GGX widths; both below kSmoothAlpha is a delta lobe. Hair: variance of its first lobe along the
  // fibre, and scale of the logistic distribution around it.
  float alpha_x = 0, alpha_y = 0;
  float eta = 1;  // Relative index, inside over outside of the surface's +z side.
  // Weight of the second row of the tables below. Principled: weight of the thin film.
  float blend = 0;
  CoatTilt coat_tilt;  // Principled: flat, unless the coat is rough.
  // Coats: never null. Conductors and dielectrics: null for single scattering alone; for conductors
  // with a row, color is the tint that repeated reflection gives the returned energy.
  union {
    const CoatRow* coat = nullptr;
    PrincipledBase base;
  };
  union {  // By kind: conductors; coated ones, whose row is never null; hair; measured; principled.
    const ConductorEnergyRow* conductor_energy = nullptr;
    const ConductorCoatRow* conductor_coat;
    HairFiber hair;
    const MeasuredBrdf* measured;         // Never null.
    const PrincipledSurface* principled;  // Never null.
  };
  union {
    const DielectricEnergyRow* dielectric_energy = nullptr;
    PrincipledTop top;
  };
};
template <typename Color>
struct BsdfOf : BsdfShape {
  Color color{};          // Reflectance (diffuse, coat base); conductors: energy; hair: absorption.
  Color conductor_eta{};  // Complex index, against what is outside of the metal. Diffuse
                          // transmission: what crosses. Measured: the wavelengths in nm.
                          // Principled: tint of the reflection at normal incidence.
  Color conductor_k{};    // Principled: color of the sheen.
  Color albedo{};  // For the albedo channel. Principled, in spectral transport: wavelengths in nm.
};
using Bsdf = BsdfOf<Rgb>;
using BsdfSample = BsdfSampleOf<Rgb>;
using BsdfValue = BsdfValueOf<Rgb>;

// Radiance transport. None where the path ends (absorbed). Where the sample is not of a delta lobe,
// pdf is EvalBsdf's for the same pair of directions, to the bit.
// A lobe whose traits a variant lacks (lobe.h) is black in it: the plan never chooses such a
// variant. Both are defined in bsdf_inl.h, which integrator variants include, and compiled for
// every variant of variant_list.h in bsdf.cc.
template <TraitBits kTraits, typename Color>
std::optional<BsdfSampleOf<Color>> SampleBsdf(const BsdfOf<Color>& bsdf, Vec3f wo, float u_lobe,
                                              Vec2f u);
// Delta lobes evaluate to 0. Hair has no sides: only its tangent, +x, has a meaning, and f_cos is
// with respect to the cross-section of the fibre.
template <TraitBits kTraits, typename Color>
BsdfValueOf<Color> EvalBsdf(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi);

// Whether light comes and goes whatever the side of the surface. Never in variants without kHair.
template <TraitBits kTraits>
bool IsHair(const BsdfShape& bsdf) {
  return Has(kTraits, Trait::kHair) && bsdf.kind == BsdfKind::kHair;
}

}  // namespace sheaf::render
