// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What matter without end beneath a smooth boundary gives back of the light that enters it, and how
// bright its scatterers must be to give back what is asked for.
#pragma once

#include <array>
#include <cstddef>

namespace sheaf {

// The share of even light through the boundary, of what has entered, that leaves again. albedo: of
// each scattering, in [0, 1], which is isotropic; eta: index of the matter over the outside.
// Exact but for quadrature (1e-3): Chandrasekhar's H functions below a boundary that reflects by
// Fresnel's equations, all orders summed. Source: Chandrasekhar 1960, "Radiative Transfer", ch. V.
double HalfSpaceReflectance(double albedo, double eta);

// Its inverse: the albedo for which the share is `reflectance`, which is clamped to [0, 1]. g: mean
// cosine of scattering; where not 0 by the similarity relation, albedo' = albedo (1 - g) /
// (1 - albedo g) (van de Hulst 1980, sec. 14.1), which is no more than close.
double AlbedoForReflectance(double reflectance, double eta, double g);

// The same from a table, for colors that are known only when rendering: within 1e-4 of the
// reflectance up to 0.99. Some milliseconds to make. Thread safety: any number of threads at once.
class AlbedoCurve {
 public:
  AlbedoCurve(double eta, double g);
  // NaN stays what it is.
  float At(float reflectance) const;

 private:
  static constexpr size_t kSteps = 1024;
  // The root of what each scattering loses, which is nearly straight, for reflectances of i/kSteps.
  std::array<float, kSteps + 1> lost_root_{};
  float g_;
};

}  // namespace sheaf
