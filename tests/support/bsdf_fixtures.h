// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Bsdfs for tests, made from the same tables the material table makes.
#pragma once

#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "common/math/elementary.h"
#include "worker/render/bsdf_inl.h"

namespace sheaf::testing {

// A Bsdf that keeps its tables alive.
struct BsdfFixture {
  std::string name;
  render::Bsdf bsdf;
  std::shared_ptr<const void> table;
};

inline render::Bsdf MakeBsdfOfKind(render::BsdfKind kind, float alpha_x = 0, float alpha_y = 0,
                                   float eta = 1) {
  render::Bsdf bsdf;
  bsdf.kind = kind;
  bsdf.alpha_x = alpha_x;
  bsdf.alpha_y = alpha_y;
  bsdf.eta = eta;
  return bsdf;
}

inline BsdfFixture MakeDiffuseFixture(Rgb reflectance) {
  BsdfFixture fixture{"diffuse", MakeBsdfOfKind(render::BsdfKind::kDiffuse), nullptr};
  fixture.bsdf.color = reflectance;
  return fixture;
}

// keeps_energy: with the lobe of returned energy; without it single scattering alone.
inline BsdfFixture MakeConductorFixture(float alpha_x, float alpha_y, Rgb eta, Rgb k,
                                        bool keeps_energy) {
  BsdfFixture fixture{"conductor " + std::to_string(alpha_x) + " " + std::to_string(alpha_y),
                      MakeBsdfOfKind(render::BsdfKind::kConductor, alpha_x, alpha_y), nullptr};
  fixture.bsdf.conductor_eta = eta;
  fixture.bsdf.conductor_k = k;
  fixture.bsdf.specular = render::Ggx{alpha_x, alpha_y}.IsSmooth();
  if (!keeps_energy || fixture.bsdf.specular) return fixture;
  const auto row = std::make_shared<render::ConductorEnergyRow>(
      render::MakeConductorEnergyRow({alpha_x, alpha_y}));
  const Rgb average = render::AverageConductorFresnel(eta, k);
  const float loss = row->lobe.average_loss;
  for (size_t c = 0; c < 3; ++c) {
    fixture.bsdf.color[c] = average[c] * average[c] * (1 - loss) / (1 - average[c] * loss);
  }
  fixture.bsdf.conductor_energy = row.get();
  fixture.table = row;
  return fixture;
}
// F = 1 in every channel.
inline BsdfFixture MakeMirrorFixture(float alpha_x, float alpha_y, bool keeps_energy) {
  return MakeConductorFixture(alpha_x, alpha_y, Rgb::Grey(1), Rgb::Grey(render::kPerfectConductorK),
                              keeps_energy);
}

inline BsdfFixture MakeDielectricFixture(float alpha_x, float alpha_y, float eta,
                                         bool keeps_energy) {
  BsdfFixture fixture{"dielectric " + std::to_string(alpha_x) + " " + std::to_string(alpha_y) +
                          " eta " + std::to_string(eta),
                      MakeBsdfOfKind(render::BsdfKind::kDielectric, alpha_x, alpha_y, eta),
                      nullptr};
  fixture.bsdf.specular = render::Ggx{alpha_x, alpha_y}.IsSmooth();
  if (!keeps_energy || fixture.bsdf.specular) return fixture;
  const auto row = std::make_shared<render::DielectricEnergyRow>(
      render::MakeDielectricEnergyRow({alpha_x, alpha_y}, eta));
  fixture.bsdf.dielectric_energy = row.get();
  fixture.table = row;
  return fixture;
}

inline BsdfFixture MakeCoatFixture(float alpha_x, float alpha_y, float eta, float thickness,
                                   Rgb reflectance) {
  const auto row =
      std::make_shared<render::CoatRow>(render::MakeCoatRow({alpha_x, alpha_y}, eta, thickness));
  BsdfFixture fixture{"coat " + std::to_string(alpha_x) + " " + std::to_string(alpha_y),
                      MakeBsdfOfKind(render::BsdfKind::kCoatedDiffuse, alpha_x, alpha_y, eta), row};
  fixture.bsdf.color = reflectance;
  fixture.bsdf.coat = row.get();
  return fixture;
}

// A direction at cosine mu; azimuth in radians.
inline Vec3f DirectionAt(float mu, float phi) {
  const float sin_theta = std::sqrt((1 - mu) * (1 + mu));
  return {sin_theta * Cos(phi), sin_theta * Sin(phi), mu};
}

}  // namespace sheaf::testing
