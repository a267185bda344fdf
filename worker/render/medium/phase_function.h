// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Phase functions: that of Henyey and Greenstein 1941, and the mixture of several where media
// overlap. All formulas use the distance from the peak, 1 - cosine, so that nothing cancels at any
// width of the peak and g = 0 needs no series.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "common/math/elementary.h"
#include "common/math/frame.h"
#include "common/math/vec.h"
#include "worker/render/color/wavelengths.h"
#include "worker/render/medium/medium_set.h"

namespace sheaf::render {

// Per solid angle; integrates to 1 over the sphere, so it is its own pdf. from_peak: 1 - cos of the
// angle to the direction of the peak, which is forward for g >= 0 and backward for g < 0; in [0,
// 2].
inline float HenyeyGreenstein(float g, float from_peak) {
  const float a = std::fabs(g);
  const float q = (1 - a) * (1 - a) + 2 * a * from_peak;
  constexpr float kInverse4Pi = static_cast<float>(1 / (4 * kPi));
  return kInverse4Pi * (1 - a) * (1 + a) / (q * std::sqrt(q));
}
// d: direction of propagation before scattering; w: after. Both unit.
inline float HenyeyGreenstein(float g, Vec3f d, Vec3f w) {
  // |w - d|^2 / 2 is 1 - cos without cancellation.
  return HenyeyGreenstein(g, 0.5f * LengthSquared(g < 0 ? w + d : w - d));
}

struct PhaseDirection {
  Vec3f w;
  float pdf = 0;
};
// Samples w. u in [0, 1)^2. Source: the inverse of the distribution of Witt 1977, solved for the
// distance from the peak.
inline PhaseDirection SampleHenyeyGreenstein(float g, Vec3f d, Vec2f u) {
  const float a = std::fabs(g);
  const float spread = (1 - a) + 2 * a * u.x;
  const float root = (1 - a) * (1 + a) / spread;  // Square root of q as above.
  const float from_peak = std::min(2.0f, (1 - a) * (1 - u.x) / spread * (root + (1 - a)));
  const float sine = std::sqrt(from_peak * (2 - from_peak));
  const SinCosPair<float> around = SinCos(static_cast<float>(2 * kPi) * u.y);
  const float cosine = g < 0 ? from_peak - 1 : 1 - from_peak;
  PhaseDirection sample;
  sample.w = Frame::FromNormal(d).ToWorld({sine * around.cos, sine * around.sin, cosine});
  sample.pdf = HenyeyGreenstein(g, from_peak);
  return sample;
}

// The phase functions of the media at a point, each weighted by its fraction of the scattering.
template <typename Color>
class PhaseMixture {
 public:
  struct Value {
    Color f;  // Per solid angle.
    float pdf = 0;
  };
  struct Sample {
    Vec3f w;
    float pdf = 0;
    Color weight;  // f / pdf.
  };

  // Call in order of g, so that equal lobes merge. part: fraction of the scattering, per component;
  // the parts sum to 1. probability: probability of choosing the lobe; the probabilities sum to 1.
  void Add(float g, const Color& part, float probability) {
    if (count_ > 0 && lobes_[count_ - 1].g == g) {
      lobes_[count_ - 1].part += part;
      lobes_[count_ - 1].probability += probability;
      return;
    }
    lobes_[count_++] = {g, part, probability};
  }

  Value Eval(Vec3f d, Vec3f w) const {
    if (count_ == 1) {
      const float f = HenyeyGreenstein(lobes_[0].g, d, w);
      return {Color::Gray(f), f};
    }
    Value value;
    for (uint32_t i = 0; i < count_; ++i) {
      const float f = HenyeyGreenstein(lobes_[i].g, d, w);
      value.f += lobes_[i].part * f;
      value.pdf += lobes_[i].probability * f;
    }
    return value;
  }

  Sample SampleDirection(Vec3f d, float u_lobe, Vec2f u) const {
    if (count_ == 1) {
      const PhaseDirection sampled = SampleHenyeyGreenstein(lobes_[0].g, d, u);
      return {sampled.w, sampled.pdf, Color::Gray(1)};
    }
    uint32_t chosen = 0;
    for (float sum = lobes_[0].probability; chosen + 1 < count_ && u_lobe >= sum;) {
      sum += lobes_[++chosen].probability;
    }
    const Vec3f w = SampleHenyeyGreenstein(lobes_[chosen].g, d, u).w;
    const Value value = Eval(d, w);
    return {w, value.pdf, value.f / value.pdf};
  }

 private:
  struct Lobe {
    float g = 0;
    Color part;
    float probability = 0;
  };
  uint32_t count_ = 0;
  std::array<Lobe, kMediaAtOnceMax> lobes_;
};

}  // namespace sheaf::render
