// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MisWeight: weights of the techniques by which a path finds a point of a light from a vertex, by
// the power heuristic over their densities. Source: Veach 1997, ch. 9.
#pragma once

#include <cstdint>

#include "worker/render/integrator/direct_light.h"
#include "worker/render/sampling/mis.h"

namespace sheaf::render {

enum class Technique : uint8_t {
  kLight,       // A light is sampled from the vertex.
  kScattering,  // The scattered ray hits the light.
  kLine,        // A light is sampled for the segment that leads to the vertex.
};

// The densities with which the techniques find the same vertex of a segment in a medium and the
// same point of a light: per distance along the segment, and per solid angle at the vertex (a
// probability for delta lights). 0 for a technique that cannot find them.
struct TechniquePdfs {
  double light = 0, scattering = 0, line = 0;
};

// For vertices that only `technique`, with density pdf, and one other technique find. Not for
// kLine.
template <typename C>
float MisWeight(Technique technique, float pdf, float other_pdf) {
  if constexpr (C::kDirectLight == DirectLight::kBySampling) {
    return technique == Technique::kLight ? 1 : 0;
  } else if constexpr (C::kDirectLight == DirectLight::kByHitting) {
    return technique == Technique::kScattering ? 1 : 0;
  } else {
    return PowerHeuristic(pdf, other_pdf);
  }
}

// For vertices on a segment in a medium. Requires: C combines techniques.
template <typename C>
double MisWeight(Technique technique, const TechniquePdfs& pdfs) {
  if constexpr (C::kDirectLight == DirectLight::kByEquiangular) {
    if (technique == Technique::kLine) return 1;
    if (pdfs.line > 0) return 0;
  }
  switch (technique) {
    case Technique::kLight:
      return PowerHeuristic(pdfs.light, pdfs.scattering, pdfs.line);
    case Technique::kScattering:
      return PowerHeuristic(pdfs.scattering, pdfs.light, pdfs.line);
    case Technique::kLine:
      break;
  }
  return PowerHeuristic(pdfs.line, pdfs.light, pdfs.scattering);
}

}  // namespace sheaf::render
