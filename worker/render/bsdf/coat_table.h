// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A clear coat over a Lambertian base, exactly and without a random walk. Light that has entered
// the coat is scattered by the base into every direction alike, so all that matters of it is the
// irradiance it makes; what the interface sends back adds a geometric series. With
//   T(w)  share of light arriving along w that reaches the base, absorption in the coat included,
//   K     share of what the base sends up that comes down to it again,
//   eta   index of the coat, rho the base's reflectance,
// the light below the interface adds to the interface's own reflection
//   f(o, i) = rho T(o) T(i) / (pi eta^2 (1 - rho K)).
// 1 / eta^2 is the widening of radiance on its way out; T serves both ways because the interface is
// reciprocal. pbrt-v4 estimates the same sum by a random walk cut off after maxdepth = 10
// crossings, that is five visits to the base: it lacks (rho K)^5, 8 % of this term for a white base
// under eta = 1.5 and below 0.3 % for rho = 0.5.
//
// For rough coats, T and K are scaled so that at thickness 0 what is not reflected enters, and what
// enters a white base comes out: the energy single scattering loses is given to the base, unless
// the loss is asked for. With anisotropic roughness T and K are averages over azimuths.
#pragma once

#include <vector>

#include "worker/render/bsdf/energy_table.h"

namespace sheaf::render {

// One alpha; eta and thickness are the material's.
struct CoatRow {
  MuCurve enter;            // T.
  MuCurve reflect;          // Albedo of the interface from outside: how often it is sampled.
  float recapture = 0;      // K.
  float enter_average = 0;  // Average of T weighted by cosine.
};

// thickness: optical depth of the coat at normal incidence (its mean free paths), >= 0.
// Requires: eta > 0.
CoatRow MakeCoatRow(const Ggx& ggx, float eta, float thickness, bool keeps_energy = true);
// All alpha nodes of energy_table.h, for textured roughness.
std::vector<CoatRow> MakeCoatTable(float eta, float thickness, bool keeps_energy = true);

}  // namespace sheaf::render
