// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Quadrature over the microfacets visible from a direction, for the energy tables. Bit-identical on
// every machine.
#pragma once

#include <cmath>

#include "common/math/elementary.h"
#include "common/math/vec.h"
#include "worker/render/bsdf/microfacet.h"

namespace sheaf::render {

// Points of the quadrature over visible normals. The azimuth is periodic and symmetric, so equal
// steps over half a turn converge fast.
inline constexpr int kFacetAzimuthCount = 24;
inline constexpr int kFacetPolarCount = 48;
// Azimuths of incidence per quarter turn, for anisotropic roughness.
inline constexpr int kIncidenceCount = 4;

// Averages visit(m) over the normals visible from wo. Steep facets, which matter for shadowing, lie
// within about alpha^2 of u.y = 1; equal steps in the cube root of 1 - u.y resolve them. turn: the
// fraction of the azimuths to include.
template <typename Visit>
auto AverageOverVisibleNormals(const Ggx& ggx, Vec3f wo, float turn, Visit visit) {
  decltype(visit(wo)) sum{};
  for (int j = 0; j < kFacetPolarCount; ++j) {
    const float root = (static_cast<float>(j) + 0.5f) / kFacetPolarCount;
    const double weight = 3.0 * root * root / (kFacetAzimuthCount * kFacetPolarCount);
    for (int i = 0; i < kFacetAzimuthCount; ++i) {
      const Vec2f u{turn * (static_cast<float>(i) + 0.5f) / kFacetAzimuthCount,
                    1 - root * root * root};
      sum += visit(ggx.SampleVisibleNormal(wo, u)) * weight;
    }
  }
  // Divides by the sum of the weights, so that the average of a constant is exact.
  return sum * (1 / (1 - 0.25 / (kFacetPolarCount * kFacetPolarCount)));
}

// Calls visit(m, weight) for that number of normals, with weights that sum to 1. All polar angles
// differ, so that an edge about the normal, such as that of total reflection, affects few of them
// at once.
template <typename Visit>
void ForEachLatticeNormal(const Ggx& ggx, Vec3f wo, Visit visit) {
  constexpr int kCount = kFacetAzimuthCount * kFacetPolarCount;
  constexpr float kGoldenRatio = 0.6180339887f;
  constexpr double kWeightSum = 1 - 0.25 / (static_cast<double>(kCount) * kCount);
  for (int i = 0; i < kCount; ++i) {
    const float root = (static_cast<float>(i) + 0.5f) / kCount;
    const float turn = kGoldenRatio * static_cast<float>(i);
    const Vec2f u{turn - std::floor(turn), 1 - root * root * root};
    visit(ggx.SampleVisibleNormal(wo, u), 3.0 * root * root / (kCount * kWeightSum));
  }
}

// Averages average(wo) over the azimuths of incidence at a cosine.
template <typename Average>
auto AverageOverIncidence(const Ggx& ggx, float mu, Average average) {
  const float sin_theta = std::sqrt((1 - mu) * (1 + mu));
  if (ggx.alpha_x == ggx.alpha_y) return average(Vec3f{sin_theta, 0, mu});
  decltype(average(Vec3f{})) sum{};
  for (int i = 0; i < kIncidenceCount; ++i) {
    const SinCosPair<float> phi =
        SinCos(static_cast<float>(kPi / 2) * (static_cast<float>(i) + 0.5f) / kIncidenceCount);
    sum += average(Vec3f{sin_theta * phi.cos, sin_theta * phi.sin, mu});
  }
  return sum * (1.0 / kIncidenceCount);
}

// Averages visit(wo, m) over the normals visible at a cosine and over azimuths of incidence.
template <typename Visit>
auto AverageAtMu(const Ggx& ggx, float mu, Visit visit) {
  const float turn = ggx.alpha_x == ggx.alpha_y ? 0.5f : 1.0f;
  return AverageOverIncidence(ggx, mu, [&](Vec3f wo) {
    return AverageOverVisibleNormals(ggx, wo, turn, [&](Vec3f m) { return visit(wo, m); });
  });
}

// G2 / G1(wo) for light that leaves along wi, on either side.
inline double ShadowingGivenVisible(const Ggx& ggx, Vec3f wo, Vec3f wi) {
  const double co = wo.z, ci = std::fabs(wi.z), so = ggx.S(wo), si = ggx.S(wi);
  return ci * (co + so) / (so * ci + si * co);
}

// Transmittance at a cosine of a layer with this optical depth at normal incidence.
inline double Attenuation(double thickness, double cosine) {
  return thickness == 0 ? 1 : Exp(-thickness / cosine);
}

}  // namespace sheaf::render
