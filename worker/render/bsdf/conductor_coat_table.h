// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A clear coat over a conductor, without a random walk. Its light is the sum of three parts:
//   1. what the interface reflects;
//   2. the base's highlight through the interface. Directions are refracted at the mean facet, the
//      base is GGX there, widened by what a rough interface does to light on its way in and out
//      (LobeThroughInterface), and light that the interface sends back keeps its direction: the
//      series over reflections is geometric,
//        f(o, i) = T(o) T(i) / eta^2  f_base(o', i') A / (1 - F A min(R(o), R(i))),
//      with R = 1 - T what the interface reflects, A the absorption along both ways and F the
//      base's reflectance. With min it is reciprocal, exact for mirrors, and never more than all;
//   3. the rest: light that repeated reflection, or total reflection, has taken out of the
//      highlight. It comes out as a wider lobe of GGX, rest(o) rest(i) D G2 / (4 cos(o) cos(i)),
//      colored by how often it has met the base.
// Energy is right because the rest is what a Markov chain over the cosines of light inside the coat
// says comes out, less the highlight; the chain is exact up to its bins. A conductor reflects about
// the same at all angles inside the coat, so the chain's reflectance is a number, and the color of
// the rest a curve over it. See docs/adr/0010. The idea of parts 1 and 2 with added widths is that
// of Belcour 2018, "Efficient Rendering of Layered Materials using an Atomic Decomposition with
// Statistical Operators"; the chain takes the place of his adding-doubling of energies.
#pragma once

#include <array>

#include "worker/render/bsdf/energy_table.h"

namespace sheaf::render {

// Keeps the geometric series finite where everything comes back for ever.
inline constexpr float kSeriesMin = 1e-6f;
inline constexpr int kTintNodeCount = 17;  // At reflectance 1 - (1 - i / 16)^2.

struct ConductorCoatRow {
  Ggx lobe;                // Of the highlight, in refracted directions.
  float thickness = 0;     // Optical depth at normal incidence.
  bool is_smooth = false;  // Both layers are mirrors: no tables, all is one delta lobe.
  MuCurve enter;           // T, without absorption; of rough interfaces what the highlight gets.
  MuCurve reflect;         // R.
  MuCurve highlight;       // Albedo of part 2 over a white base: how often it is sampled.
  MuCurve rest_albedo;     // Albedo of part 3 over a white base.
  Ggx rest_lobe;
  MuCurve rest;  // What part 3 scales its lobe by, for either direction.
  // Share of the rest that a base of the node's reflectance leaves of it.
  std::array<float, kTintNodeCount> tint{};

  // reflectance: of the base inside the coat, averaged over cosines.
  float Tint(float reflectance) const;
};

// thickness: optical depth of the coat at normal incidence (its mean free paths), >= 0. Requires:
// eta > 0. With anisotropic roughness the curves are averages over azimuths.
ConductorCoatRow MakeConductorCoatRow(const Ggx& interface, const Ggx& base, float eta,
                                      float thickness, bool keeps_energy = true);

}  // namespace sheaf::render
