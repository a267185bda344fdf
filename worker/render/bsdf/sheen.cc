// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/bsdf/sheen.h"

namespace sheaf::render {
namespace {

// Equal steps of both angles; the integrand is smooth and periodic in the azimuth.
constexpr int kPolarCount = 96, kAzimuthCount = 48;

double AlbedoAt(const Sheen& sheen, float mu) {
  const Vec3f wo{std::sqrt((1 - mu) * (1 + mu)), 0, mu};
  const double d_theta = kPi / 2 / kPolarCount, d_phi = kPi / kAzimuthCount;
  double sum = 0;
  for (int j = 0; j < kPolarCount; ++j) {
    const SinCosPair<float> theta = SinCos(static_cast<float>((j + 0.5) * d_theta));
    for (int i = 0; i < kAzimuthCount; ++i) {
      const SinCosPair<float> phi = SinCos(static_cast<float>((i + 0.5) * d_phi));
      const Vec3f wi{theta.sin * phi.cos, theta.sin * phi.sin, theta.cos};
      sum += static_cast<double>(sheen.Value(wo, wi)) * static_cast<double>(theta.sin);
    }
  }
  return sum * d_theta * d_phi * 2;  // The other half of the azimuths.
}

}  // namespace

Sheen Sheen::Make(float roughness) {
  const float clamped = std::max(roughness, kSheenRoughnessMin);
  Sheen sheen;
  sheen.exponent = 1 / (clamped * clamped);
  float largest = 0;
  for (int i = 0; i < kMuNodeCount; ++i) {
    sheen.albedo.value[i] = static_cast<float>(AlbedoAt(sheen, std::max(MuNode(i), 1e-5f)));
    largest = std::max(largest, sheen.albedo.value[i]);
  }
  if (largest > 1) {
    sheen.scale = 1 / largest;
    for (float& value : sheen.albedo.value) value *= sheen.scale;
  }
  sheen.lobe = LossLobe::Make(sheen.albedo);
  return sheen;
}

}  // namespace sheaf::render
