// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Distance sampling, transmittance and emission in homogeneous media, in closed form. Valid for all
// optical thicknesses, including infinite ones, and for infinite lengths.
//
// Where media absorb or scatter the color components differently, the distance is sampled for one
// component, chosen by throughput, and weighted by the density of all of them (one-sample balance
// heuristic: Veach 1997, sec. 9.2; Wilkie et al. 2014). Only differences of optical thickness to
// that of the clearest component enter, so that no weight is 0 / 0. Gray media need none of this: a
// path that reaches the end keeps its throughput, a scattered one is multiplied by the albedo.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <limits>

#include "common/math/elementary.h"
#include "worker/render/color/wavelengths.h"
#include "worker/render/sampling/sampler.h"

namespace sheaf::render {

// The form of a medium: its true properties, or a reduced form that has the same effect after many
// scattering events: forward scattering is replaced by isotropic but rarer scattering: sigma_s' =
// sigma_s (1 - g), g' = 0. This preserves only the diffusion of light deep in the medium. Sources:
// Wyman, Patterson and Wilson 1989; Zhao, Ramamoorthi and Bala 2014. See docs/adr/0031.
enum class MediumForm : uint8_t { kTrue, kReduced };

// Properties of the media at a place, per scene unit: sums over the media.
template <typename Color>
struct MediumProperties {
  Color sigma_t, sigma_s;
  Color emission;           // Radiance per scene unit.
  bool is_gray = true;      // sigma_t and sigma_s are the same in all components.
  bool scatters = false;    // sigma_s is not black.
  bool is_bounded = false;  // Closed surfaces surround one of them on all sides.
  // There are also heterogeneous media, which the sums do not include.
  bool is_heterogeneous = false;
  bool has_emissive_grid = false;  // A heterogeneous one emits.
  bool gathers = false;            // Lines through a heterogeneous one gather light.
  bool is_subsurface = false;      // One of them is a subsurface medium.
  bool is_hidden = false;          // A subsurface medium that shadow rays cannot leave.
  MediumForm form = MediumForm::kTrue;
};

// distance: uniform in [0, 1), with more than float precision: thin media need values near 0.
struct DistanceUniforms {
  double distance = 0;
  float component = 0;
};
// From a slot's numbers, for the pass-th segment: later segments get hashed ones.
inline DistanceUniforms MakeDistanceUniforms(const std::array<float, 4>& u, uint32_t pass) {
  if (pass == 0) return {static_cast<double>(u[0]) + 0x1p-24 * static_cast<double>(u[1]), u[2]};
  uint64_t state = (uint64_t{std::bit_cast<uint32_t>(u[0])} << 32) | std::bit_cast<uint32_t>(u[1]);
  state = MixBits(state + uint64_t{pass} * 0x9e3779b97f4a7c15u);
  const uint64_t more = MixBits(state ^ std::bit_cast<uint32_t>(u[2]));
  return {static_cast<double>(state >> 16) * 0x1p-48, static_cast<float>(more >> 40) * 0x1p-24f};
}

// e^-tau. tau may be infinite.
inline float AttenuationOf(double tau) {
  const elementary::ExpParts p = elementary::ExpForFloat(elementary::ClampExpArgument(-tau));
  return static_cast<float>(std::fma(p.scale, p.expm1_of_r, p.scale));
}
// sigma * length; 0 for sigma = 0 even if length is infinite.
inline double OpticalThickness(double sigma, double length) {
  return sigma == 0 ? 0 : sigma * length;
}

// Transmittance over `length`.
template <bool kChromatic, typename Color>
Color TransmittanceOf(const MediumProperties<Color>& properties, double length) {
  if (!kChromatic || properties.is_gray) {
    return Color::Gray(AttenuationOf(OpticalThickness(properties.sigma_t[0], length)));
  }
  return MakeColor<Color>(
      [&](size_t i) { return AttenuationOf(OpticalThickness(properties.sigma_t[i], length)); });
}

// Emitted radiance that arrives from `length`.
template <typename Color>
Color EmissionAlong(const MediumProperties<Color>& properties, double length) {
  return MakeColor<Color>([&](size_t i) -> float {
    if (properties.emission[i] == 0)
      return 0;  // Media that emit also absorb: sigma_t is positive below.
    const float tau = static_cast<float>(OpticalThickness(properties.sigma_t[i], length));
    return properties.emission[i] * (-Expm1(-tau) / properties.sigma_t[i]);
  });
}

// A point on a segment that emits, and its density per scene unit.
struct EmissionSample {
  double distance = 0;
  double pdf = 0;
};

// Samples the point by the arriving radiance of one component, chosen uniformly among those that
// emit; the density is the mean over them, so that no component of radiance / pdf exceeds its
// EmissionAlong by more than their number (one-sample balance heuristic: Veach 1997, sec. 9.2).
// choice, u: uniform in [0, 1). Requires: properties.emission is not black.
template <typename Color>
EmissionSample SampleEmission(const MediumProperties<Color>& properties, double length,
                              double choice, double u) {
  std::array<double, kComponentCount<Color>> sigma{};
  size_t count = 0;
  for (size_t i = 0; i < kComponentCount<Color>; ++i) {
    if (properties.emission[i] > 0) sigma[count++] = static_cast<double>(properties.sigma_t[i]);
  }
  const auto absorbed = [&](size_t i) { return -Expm1(-sigma[i] * length); };
  const size_t chosen =
      std::min(static_cast<size_t>(choice * static_cast<double>(count)), count - 1);
  EmissionSample point;
  point.distance = -Log1p(-u * absorbed(chosen)) / sigma[chosen];
  for (size_t i = 0; i < count; ++i) {
    point.pdf += sigma[i] * Exp(-sigma[i] * point.distance) / absorbed(i);
  }
  point.pdf /= static_cast<double>(count);
  return point;
}

template <typename Color>
struct DistanceSample {
  bool scatters = false;  // After `distance`; otherwise the path reaches the end.
  double distance = 0;
  Color weight = Color::Gray(1);  // Factor of the path's throughput.
};

namespace internal {

// Probabilities of choosing each component.
template <typename Color>
Color ComponentProbabilities(const Color& throughput) {
  float sum = 0;
  for (size_t i = 0; i < kComponentCount<Color>; ++i) sum += throughput[i];
  return throughput / sum;
}
template <typename Color>
size_t ChooseComponent(const Color& probabilities, float u) {
  size_t chosen = 0;
  float sum = 0;
  for (size_t i = 0; i < kComponentCount<Color>; ++i) {
    if (probabilities[i] == 0) continue;
    chosen = i;
    sum += probabilities[i];
    if (u < sum) break;
  }
  return chosen;
}

template <typename Color>
DistanceSample<Color> SampleChromaticDistance(const MediumProperties<Color>& properties,
                                              double length, const DistanceUniforms& u,
                                              const Color& throughput) {
  const Color probabilities = ComponentProbabilities(throughput);
  const size_t chosen = ChooseComponent(probabilities, u.component);
  const double sigma = properties.sigma_t[chosen];
  DistanceSample<Color> sample;
  sample.distance =
      sigma == 0 ? std::numeric_limits<double>::infinity() : -Log1p(-u.distance) / sigma;
  sample.scatters = sample.distance < length;
  const double traveled = sample.scatters ? sample.distance : length;
  float clearest = properties.sigma_t[chosen];
  for (size_t i = 0; i < kComponentCount<Color>; ++i) {
    if (probabilities[i] > 0 && properties.sigma_t[i] < clearest) clearest = properties.sigma_t[i];
  }
  // Transmittance of each component relative to the clearest: at most 1, and large enough for the
  // chosen one that the density below is not 0.
  Color left;
  float density = 0;
  for (size_t i = 0; i < kComponentCount<Color>; ++i) {
    if (probabilities[i] == 0) continue;
    const double more = static_cast<double>(properties.sigma_t[i]) - static_cast<double>(clearest);
    left[i] = AttenuationOf(OpticalThickness(more, traveled));
    density += probabilities[i] * left[i] * (sample.scatters ? properties.sigma_t[i] : 1);
  }
  sample.weight = (sample.scatters ? properties.sigma_s * left : left) / density;
  return sample;
}

}  // namespace internal

// Samples whether and where a path with `throughput` is scattered within `length`. Media that only
// absorb never scatter; their absorption is in the weight. Requires: throughput is nonnegative, not
// black.
template <bool kChromatic, typename Color>
DistanceSample<Color> SampleDistance(const MediumProperties<Color>& properties, double length,
                                     const DistanceUniforms& u,
                                     [[maybe_unused]] const Color& throughput) {
  DistanceSample<Color> sample;
  if (!properties.scatters) {
    sample.weight = TransmittanceOf<kChromatic>(properties, length);
    return sample;
  }
  if constexpr (kChromatic) {
    if (!properties.is_gray)
      return internal::SampleChromaticDistance(properties, length, u, throughput);
  }
  const double sigma = properties.sigma_t[0];
  sample.distance = -Log1p(-u.distance) / sigma;
  sample.scatters = sample.distance < length;
  if (sample.scatters) sample.weight = Color::Gray(properties.sigma_s[0] / properties.sigma_t[0]);
  return sample;
}

// The density, per scene unit, with which SampleDistance with the same throughput scatters a path
// at `distance`. Requires: properties.scatters.
template <bool kChromatic, typename Color>
double DistancePdf(const MediumProperties<Color>& properties, double distance,
                   [[maybe_unused]] const Color& throughput) {
  const auto of_component = [&](size_t i) {
    return static_cast<double>(properties.sigma_t[i] *
                               AttenuationOf(OpticalThickness(properties.sigma_t[i], distance)));
  };
  if constexpr (kChromatic) {
    if (!properties.is_gray) {
      const Color probabilities = internal::ComponentProbabilities(throughput);
      double density = 0;
      for (size_t i = 0; i < kComponentCount<Color>; ++i) {
        if (probabilities[i] > 0)
          density += static_cast<double>(probabilities[i]) * of_component(i);
      }
      return density;
    }
  }
  return of_component(0);
}

// Approximate collision density of a heterogeneous medium at a place, per scene unit: the mean over
// components, weighted by throughput. Requires: throughput is not black.
template <bool kChromatic, typename Color>
double MeanExtinction(const Color& sigma_t, [[maybe_unused]] const Color& throughput) {
  if constexpr (!kChromatic) return static_cast<double>(sigma_t[0]);
  const Color probabilities = internal::ComponentProbabilities(throughput);
  double sum = 0;
  for (size_t i = 0; i < kComponentCount<Color>; ++i) {
    sum += static_cast<double>(probabilities[i]) * static_cast<double>(sigma_t[i]);
  }
  return sum;
}

}  // namespace sheaf::render
