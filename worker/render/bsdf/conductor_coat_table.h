// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A clear coat over a conductor, without a random walk. The reflection is the sum of three parts:
//   1. the reflection of the interface;
//   2. the base's highlight through the interface. Directions are refracted at the mean facet, the
//      base is GGX there, widened by the rough interface on the way in and out
//      (LobeThroughInterface), and light that the interface reflects back keeps its direction: the
//      series of reflections is geometric,
//        f(o, i) = T(o) T(i) / eta^2  f_base(o', i') A / (1 - F A min(R(o), R(i))),
//      with R = 1 - T the reflectance of the interface, A the absorption along both ways and F the
//      base's reflectance. With min it is reciprocal, exact for mirrors, and conserves energy;
//   3. the rest: light that left the highlight by repeated reflection or total reflection. It
//   leaves
//      in a wider GGX lobe, rest(o) rest(i) D G2 / (4 cos(o) cos(i)), colored by the number of its
//      reflections at the base.
// Energy is right because the rest is the light that leaves a Markov chain over the cosines inside
// the coat, minus the highlight; the chain is exact up to its bins. A conductor's reflectance is
// nearly constant over the angles inside the coat, so the chain's reflectance is a number, and the
// color of the rest a curve over it. See docs/adr/0010. Parts 1 and 2 with added widths follow
// Belcour 2018, "Efficient Rendering of Layered Materials using an Atomic Decomposition with
// Statistical Operators"; the chain replaces his adding-doubling of energies.
#pragma once

#include <array>
#include <cmath>

#include "worker/render/bsdf/energy_table.h"
#include "worker/render/bsdf/microfacet.h"

namespace sheaf::render {

// Keeps the geometric series finite where no light is lost.
inline constexpr float kSeriesMin = 1e-6f;
// Minimum alpha of a lobe in either direction. The same minimum as for other materials.
inline constexpr float kLobeAlphaMin = 1e-4f;
inline constexpr int kTintNodeCount = 17;  // At reflectance 1 - (1 - i / 16)^2.

struct ConductorCoatRow {
  // The width of the highlight's lobe over refracted directions: by axis, the parts of the base
  // and of the interface, and by cosine outside how much of the latter counts. See LobeAt.
  std::array<float, 2> base_width{}, interface_width{};
  MuCurve bend;
  float thickness = 0;     // Optical depth at normal incidence.
  bool is_smooth = false;  // Both layers are mirrors: no tables, a single delta lobe.
  MuCurve enter;           // T, without absorption; for rough interfaces fitted to the highlight.
  MuCurve reflect;         // R.
  MuCurve highlight;       // Albedo of part 2 over a white base: its sampling probability.
  MuCurve rest_albedo;     // Albedo of part 3 over a white base.
  Ggx rest_lobe;
  MuCurve rest;  // Scale of part 3's lobe, for either direction.
  // Fraction of the rest that remains over a base with the node's reflectance.
  std::array<float, kTintNodeCount> tint{};

  // The highlight's lobe between two directions outside the coat, with bend.At of each. The facets
  // of a rough interface turn light by angles inside the coat that grow towards grazing incidence.
  Ggx LobeAt(float bend_o, float bend_i) const {
    const auto alpha = [&](size_t axis) {
      // Widths add up as the power 4/3: between squares, as of normal distributions, and the widths
      // themselves, as of the long tails of GGX. Random walks agree best with it.
      const float sum = base_width[axis] + interface_width[axis] * (bend_o + bend_i);
      const float root = std::sqrt(sum);
      return std::fmax(root * std::sqrt(root), kLobeAlphaMin);
    };
    return {alpha(0), alpha(1)};
  }
  // reflectance: of the base inside the coat, averaged over cosines.
  float Tint(float reflectance) const;
};

// thickness: optical depth of the coat at normal incidence (in mean free paths), >= 0. Requires:
// eta > 0. With anisotropic roughness the curves are averages over azimuths.
ConductorCoatRow MakeConductorCoatRow(const Ggx& interface, const Ggx& base, float eta,
                                      float thickness, bool keeps_energy = true);

}  // namespace sheaf::render
