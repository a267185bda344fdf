// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Functions of several scattering models: cosine-distributed directions, blended loss lobes, and
// the step from a chosen direction to a sample.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "common/math/elementary.h"
#include "worker/render/bsdf/bsdf.h"
#include "worker/render/bsdf/energy_table.h"

namespace sheaf::render {

// A direction about +z with pdf cos / pi; z > 0. Source: Shirley and Chiu 1997, "A Low Distortion
// Map Between Disk and Square", lifted to the hemisphere (Malley).
inline Vec3f SampleCosineHemisphere(Vec2f u) {
  const float a = 2 * u.x - 1, b = 2 * u.y - 1;
  if (a == 0 && b == 0) return {0, 0, 1};
  const float quarter_pi = static_cast<float>(kPi / 4);
  const bool a_longer = std::fabs(a) > std::fabs(b);
  const float r = a_longer ? a : b;
  const SinCosPair<float> phi = SinCos(a_longer ? quarter_pi * (b / a) : quarter_pi * (a / b));
  const float x = a_longer ? r * phi.cos : r * phi.sin;
  const float y = a_longer ? r * phi.sin : r * phi.cos;
  // 1 - r^2 as a product; the floor keeps z > 0 on the rim.
  return {x, y, std::sqrt(std::max(1e-12f, (1 - r) * (1 + r)))};
}

// A direction with the given cosine and azimuth 2 pi u.
inline Vec3f DirectionAtMu(float mu, float u) {
  const float sin_theta = std::sqrt(std::max(0.0f, (1 - mu) * (1 + mu)));
  const SinCosPair<float> phi = SinCos(2 * static_cast<float>(kPi) * u);
  return {sin_theta * phi.cos, sin_theta * phi.sin, mu};
}

// One loss lobe, or a mixture of two neighbours in alpha.
struct BlendedLoss {
  const LossLobe* first = nullptr;
  const LossLobe* second = nullptr;  // Null: the first alone.
  float blend = 0;

  float Mix(float a, float b) const { return a + blend * (b - a); }
  float Loss(MuPosition p) const {
    return second ? Mix(first->loss.At(p), second->loss.At(p)) : first->loss.At(p);
  }
  float Average() const {
    return second ? Mix(first->average_loss, second->average_loss) : first->average_loss;
  }
  // 0 where nothing is lost at all.
  float LossOverAverage(MuPosition p) const {
    const float average = Average();
    return average > 0 ? Loss(p) / average : 0;
  }
  float Pdf(MuPosition p, float mu) const {
    return second ? Mix(first->Pdf(p, mu), second->Pdf(p, mu)) : first->Pdf(p, mu);
  }
  // Direction with z > 0 and pdf Pdf. u_row in [0, 1) chooses among the two.
  Vec3f Sample(float u_row, Vec2f u) const {
    const LossLobe& lobe = second && u_row < blend ? *second : *first;
    return DirectionAtMu(lobe.SampleMu(u.x), u.y);
  }
};
inline BlendedLoss LossOf(const ConductorEnergyRow* row, float blend) {
  return {&row[0].lobe, blend > 0 ? &row[1].lobe : nullptr, blend};
}
inline BlendedLoss LossOutside(const DielectricEnergyRow* row, float blend) {
  return {&row[0].out, blend > 0 ? &row[1].out : nullptr, blend};
}
inline BlendedLoss LossInside(const DielectricEnergyRow* row, float blend) {
  return {&row[0].in, blend > 0 ? &row[1].in : nullptr, blend};
}

// A sample of a direction that was drawn with value.pdf. None where it carries nothing.
template <typename Color>
std::optional<BsdfSampleOf<Color>> FinishSample(const BsdfValueOf<Color>& value, Vec3f wi,
                                                uint8_t flags, float eta_scale = 1) {
  if (!(value.pdf > 0) || value.f_cos.IsBlack()) return std::nullopt;
  return BsdfSampleOf<Color>{.wi = wi,
                             .weight = value.f_cos / value.pdf,
                             .pdf = value.pdf,
                             .eta_scale = eta_scale,
                             .flags = flags};
}

}  // namespace sheaf::render
