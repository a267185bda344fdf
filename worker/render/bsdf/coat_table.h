// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A clear coat over a Lambertian base, exactly and without a random walk. The base scatters light
// in the coat uniformly into all directions, so only its irradiance matters, and interreflection
// with the interface is a geometric series. With
//   T(w)  fraction of light from w that reaches the base, including absorption in the coat,
//   K     fraction of the light leaving the base that returns to it,
//   eta   index of the coat, rho the base's reflectance,
// the light below the interface adds to the interface's own reflection
//   f(o, i) = rho T(o) T(i) / (pi eta^2 (1 - rho K)).
// 1 / eta^2 accounts for the widening of radiance on its way out; T serves both directions because
// the interface is reciprocal. pbrt-v4 estimates the same sum by a random walk cut off after
// maxdepth = 10 crossings, that is five visits to the base: it lacks (rho K)^5, 8 % of this term
// for a white base under eta = 1.5 and below 0.3 % for rho = 0.5.
//
// For rough coats, T and K are scaled so that at thickness 0 all light that is not reflected
// enters, and all light that enters leaves a white base again: the energy lost by single scattering
// goes to the base, unless the loss is requested. With anisotropic roughness T and K are averages
// over azimuths.
#pragma once

#include <vector>

#include "worker/render/bsdf/energy_table.h"

namespace sheaf::render {

// One alpha; eta and thickness are the material's.
struct CoatRow {
  MuCurve enter;            // T.
  MuCurve reflect;          // Albedo of the interface from outside: its sampling probability.
  float recapture = 0;      // K.
  float enter_average = 0;  // Cosine-weighted average of T.
};

// thickness: optical depth of the coat at normal incidence (in mean free paths), >= 0.
// Requires: eta > 0.
CoatRow MakeCoatRow(const Ggx& ggx, float eta, float thickness, bool keeps_energy = true);
// All alpha nodes of energy_table.h, for textured roughness.
std::vector<CoatRow> MakeCoatTable(float eta, float thickness, bool keeps_energy = true);

}  // namespace sheaf::render
