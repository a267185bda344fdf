// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MisWeight: weights of the techniques by which a path finds a point of a light from a vertex.
// Source: Veach 1997, ch. 9.
#pragma once

#include "worker/render/densities/weights.h"
#include "worker/render/integrator/direct_light.h"

namespace sheaf::render {

// The densities with which the techniques find the same vertex of a segment in a medium and the
// same point of a light: per distance along the segment, and per solid angle at the vertex (a
// probability for delta lights). 0 for a technique that cannot find them.
struct TechniquePdfs {
  double light = 0, scattering = 0, line = 0;
};

// For vertices that only `technique`, with density pdf, and one other technique find. Not for
// kLine.
template <typename C>
float MisWeight(FindsBy technique, float pdf, float other_pdf) {
  if constexpr (C::kDirectLight == DirectLight::kBySampling) {
    return technique == FindsBy::kLightSample ? 1 : 0;
  } else if constexpr (C::kDirectLight == DirectLight::kByHitting) {
    return technique == FindsBy::kHit ? 1 : 0;
  } else {
    return WeightOf(pdf, other_pdf);
  }
}

// For vertices on a segment in a medium. Requires: C combines techniques.
template <typename C>
double MisWeight(FindsBy technique, const TechniquePdfs& pdfs) {
  if constexpr (C::kDirectLight == DirectLight::kByEquiangular) {
    if (technique == FindsBy::kLine) return 1;
    if (pdfs.line > 0) return 0;
  }
  if (technique == FindsBy::kLightSample) {
    return WeightOf(pdfs.light, pdfs.scattering, pdfs.line);
  }
  if (technique == FindsBy::kHit) return WeightOf(pdfs.scattering, pdfs.light, pdfs.line);
  return WeightOf(pdfs.line, pdfs.light, pdfs.scattering);
}

}  // namespace sheaf::render
