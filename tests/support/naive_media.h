// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Common formulas of light in media in single precision. docs/hard-cases.md says for each row where
// the formula breaks down; tests record their results beside the expected values (hard_case.h).
#pragma once

#include <cmath>
#include <vector>

#include "common/math/vec.h"

namespace sheaf::naive {

// V1: the weight of a distance sample, transmittance over its pdf times scattering.
inline float WeightOfFlight(float sigma_s, float sigma_t, float distance) {
  const float transmittance = std::exp(-sigma_t * distance);
  return sigma_s * transmittance / (sigma_t * transmittance);
}

// V2, V9, V10: the fraction of light that an optical thickness absorbs, or emits itself.
inline float Taken(float tau) { return 1 - std::exp(-tau); }

// V3: the optical thickness of a step to the next collision if there are no collisions.
inline float StepThickness(float majorant, float u) {
  const float step = -std::log(1 - u) / majorant;
  return majorant * step;
}

// V4: the remaining extinction for null collisions.
inline float NullExtinction(float majorant, float sigma_a, float sigma_s) {
  return majorant - sigma_a - sigma_s;
}

// V6: transmittance over a length.
inline float Transmittance(float sigma, float length) { return std::exp(-sigma * length); }

// V7: the angle that a span of the ray subtends at a light at this height.
inline float AngleOfSpan(float height, float begin, float end) {
  return std::atan(end / height) - std::atan(begin / height);
}

// V8: the medium of a path after leaving one, by a stack of the entered media.
inline int MediumAfterLeaving(std::vector<int> entered) {
  entered.pop_back();
  return entered.empty() ? 0 : entered.back();
}

// V11: the weight of the thinnest of three components at the end of a length that was sampled by
// the thickest alone.
inline float WeightByThickest(float thinnest_tau, float thickest_tau) {
  return std::exp(-thinnest_tau) / std::exp(-thickest_tau);
}

// V12: throughput after bounces without loss, by the mean of the pdfs of three components of equal
// extinction.
inline float FurnaceThroughput(float sigma, int bounces) {
  float throughput = 1, u = 0.5f;
  for (int i = 0; i < bounces; ++i) {
    u += 0.618034f;
    u -= std::floor(u);
    const float density = sigma * std::exp(std::log(1 - u));
    throughput *= density / ((density + density + density) * (1.0f / 3));
  }
  return throughput;
}

// V13: x of the first axis of a frame about d. Source: Frisvad 2012.
inline float FrameX(Vec3f d) { return 1 - d.x * d.x * (1 / (1 + d.z)); }

// V14: the distance that steps of this length move away from 1, over their sum.
inline float PartOfSteps(float step, int count) {
  float at = 1;
  for (int i = 0; i < count; ++i) at += step;
  return (at - 1) / (step * static_cast<float>(count));
}

// V15: the optical thickness of a constant density by many equal steps.
inline float MarchedThickness(float sigma, float length, int steps) {
  const float step = length / static_cast<float>(steps);
  float tau = 0;
  for (int i = 0; i < steps; ++i) tau += sigma * step;
  return tau;
}

}  // namespace sheaf::naive
