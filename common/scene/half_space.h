// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Diffuse reflectance of a semi-infinite medium beneath a smooth boundary, and its inverse: the
// albedo of the scatterers that yields a requested reflectance.
#pragma once

#include <array>
#include <cstddef>

namespace sheaf {

// The fraction of uniform incident light, once it has entered through the boundary, that leaves
// again. albedo: of single scattering, in [0, 1], isotropic; eta: index of the medium over that of
// the outside. Exact but for quadrature (1e-3): Chandrasekhar's H functions below a boundary that
// reflects by Fresnel's equations, all orders summed. Source: Chandrasekhar 1960, "Radiative
// Transfer", ch. V.
double HalfSpaceReflectance(double albedo, double eta);

// Its inverse: the albedo for which that fraction is `reflectance`, which is clamped to [0, 1]. g:
// mean cosine of scattering; if not 0, the similarity relation albedo' = albedo (1 - g) / (1 -
// albedo g) (van de Hulst 1980, sec. 14.1) is used, which is only approximate.
double AlbedoForReflectance(double reflectance, double eta, double g);

// The same from a table, for colors that are known only during rendering: within 1e-4 of the
// reflectance up to 0.99. Takes some milliseconds to build.
// Thread safety: const, any number of threads at once.
class AlbedoCurve {
 public:
  AlbedoCurve(double eta, double g);
  // NaN in gives NaN out.
  float At(float reflectance) const;

 private:
  static constexpr size_t kSteps = 1024;
  // The square root of the absorbed fraction (1 - albedo), which is nearly straight, for
  // reflectances of i/kSteps.
  std::array<float, kSteps + 1> lost_root_{};
  float g_;
};

}  // namespace sheaf
