// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// BSDFs for tests, made from the same tables as in the material table.
#pragma once

#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "common/math/elementary.h"
#include "worker/render/bsdf/bsdf_inl.h"

namespace sheaf::testing {

// A Bsdf together with the tables that it refers to.
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

inline BsdfFixture MakeSheetFixture(Rgb reflectance, Rgb transmittance) {
  BsdfFixture fixture{"diffuse transmission",
                      MakeBsdfOfKind(render::BsdfKind::kDiffuseTransmission), nullptr};
  fixture.bsdf.color = reflectance;
  fixture.bsdf.conductor_eta = transmittance;
  return fixture;
}

// keeps_energy: with the lobe of energy compensation; otherwise single scattering only.
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
  return MakeConductorFixture(alpha_x, alpha_y, Rgb::Gray(1), Rgb::Gray(render::kPerfectConductorK),
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

// Roughness of the interface and of the base. reflectance: of every component at every angle if it
// is 1; otherwise the base is a conductor of index 1 with this reflectance at normal incidence
// inside the coat.
inline BsdfFixture MakeConductorCoatFixture(render::Ggx interface, render::Ggx base, float eta,
                                            float thickness, float reflectance,
                                            bool keeps_energy = true) {
  const auto row = std::make_shared<render::ConductorCoatRow>(
      render::MakeConductorCoatRow(interface, base, eta, thickness, keeps_energy));
  BsdfFixture fixture{
      "coated conductor " + std::to_string(interface.alpha_x) + " over " +
          std::to_string(base.alpha_x),
      MakeBsdfOfKind(render::BsdfKind::kCoatedConductor, interface.alpha_x, interface.alpha_y, eta),
      row};
  fixture.bsdf.specular = row->is_smooth;
  fixture.bsdf.conductor_coat = row.get();
  const float k = reflectance >= 1 ? render::kPerfectConductorK
                                   : 2 * std::sqrt(reflectance / (1 - reflectance));
  fixture.bsdf.conductor_eta = Rgb::Gray(1);
  fixture.bsdf.conductor_k = Rgb::Gray(k);
  fixture.bsdf.color = Rgb::Gray(row->Tint(render::AverageConductorFresnel(1, k)));
  return fixture;
}

// offset: across the fiber, in [-1, 1]. absorption: per fiber radius.
inline BsdfFixture MakeHairFixture(float beta_m, float beta_n, float offset, Rgb absorption,
                                   float eta = 1.55f, float tilt_degrees = 2) {
  BsdfFixture fixture{"hair " + std::to_string(beta_m) + " " + std::to_string(beta_n) + " at " +
                          std::to_string(offset) + " eta " + std::to_string(eta),
                      MakeBsdfOfKind(render::BsdfKind::kHair, render::HairVariance(beta_m),
                                     render::HairLogisticScale(beta_n), eta),
                      nullptr};
  fixture.bsdf.color = absorption;
  fixture.bsdf.hair.offset = offset;
  fixture.bsdf.hair.sin_tilt = Sin(tilt_degrees * static_cast<float>(kPi / 180));
  return fixture;
}

// A direction with cosine mu to the z axis; azimuth in radians.
inline Vec3f DirectionAt(float mu, float phi) {
  const float sin_theta = std::sqrt((1 - mu) * (1 + mu));
  return {sin_theta * Cos(phi), sin_theta * Sin(phi), mu};
}

}  // namespace sheaf::testing
