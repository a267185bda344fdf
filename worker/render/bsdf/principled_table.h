// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Reflection and transmission of rough principled surfaces, tabulated over the
// cosine of incidence for each alpha. The Fresnel term of a tinted dielectric is linear in two
// colors, F = f0 + (f90 - f0) rise(c), where rise goes from 0 at normal incidence to 1 as the exact
// Fresnel term does; a metal's is, with Schlick's weight in its place. So a few curves give the
// albedo for all colors, and what single scattering loses of it, to the precision of the tables. A
// thin film needs a curve for each component: the three of RGB, or kFilmNodeCount wavelengths.
// Sources: Karis 2013, "Real Shading in Unreal Engine 4" (albedos linear in f0); OpenPBR 1.1, sec.
// 3.4 (the rescaled Fresnel term of tinted dielectrics); energy_table.h for the rest.
//
// Thread safety: plain values; made once, when a scene is compiled, with the same bits everywhere.
#pragma once

#include <vector>

#include "worker/render/bsdf/energy_table.h"
#include "worker/render/bsdf/fresnel.h"
#include "worker/render/bsdf/sheen.h"
#include "worker/render/bsdf/thin_film.h"

namespace sheaf::render {

// A dielectric's Fresnel term as a curve from 0 to 1; eta >= 1, inside over outside.
struct FresnelRise {
  float eta = 1.5f;
  float f0 = 0.04f;  // At normal incidence.
  static FresnelRise Make(float eta) {
    const float root = (eta - 1) / (eta + 1);
    return {eta, root * root};
  }
  // cos_o: cosine outside, in [0, 1].
  float At(float cos_o) const {
    const float f = FresnelDielectric(cos_o, eta).reflectance;
    return f > f0 ? (f - f0) / (1 - f0) : 0;
  }
};

struct AveragedCurve {
  MuCurve curve;
  float average = 0;  // curve.CosineAverage().
};

// Shares of light that arrives on one side of a rough surface, after one scattering. Facets that
// reflect totally, from inside, count for `total` and no `rise`.
struct FacetShares {
  AveragedCurve mirror;                   // Reflected, where each facet reflects all.
  AveragedCurve rise;                     // Reflected, weighted by the rise at the facet.
  AveragedCurve total;                    // Reflected totally.
  AveragedCurve cross;                    // Refracted, where each facet lets all through.
  AveragedCurve cross_rise;               // Refracted, weighted by the rise.
  std::vector<AveragedCurve> film;        // Reflected, by the film's reflectance.
  std::vector<AveragedCurve> film_cross;  // Refracted, weighted by it.
};

// One alpha.
struct PrincipledRow {
  FacetShares out, in;    // Light from the side of index 1, and from inside.
  AveragedCurve schlick;  // Reflected outside, weighted by Schlick's weight.
  LossLobe mirror_loss;   // 1 - out.mirror.
  // The loss of a dielectric without tint on either side. Only their densities are used: what is
  // returned follows from the shares.
  LossLobe glass_loss_out, glass_loss_in;
};

// Wavelengths of the curves of a film in spectral transport, at equal steps.
inline constexpr int kFilmNodeCount = 48;
inline constexpr float kFilmStepNm =
    (kWavelengthMaxNm - kWavelengthMinNm) / static_cast<float>(kFilmNodeCount - 1);

struct PrincipledTableOptions {
  float eta = 1.5f;
  bool refracts = false;  // Otherwise the curves of what crosses, and those of the inside, are 0.
  bool keeps_energy = true;  // Otherwise nothing is lost, so that nothing is returned.
  const ThinFilm* film = nullptr;
  bool spectral = false;
};

struct PrincipledTable {
  // One for constant roughness, else one for each alpha node.
  std::vector<PrincipledRow> rows;
  float rise_average = 0;           // The average of a smooth surface, cosine-weighted.
  std::vector<float> film_average;  // The film's reflectance likewise, by component.

  static PrincipledTable Make(const PrincipledTableOptions& options, const Ggx& ggx);
  static PrincipledTable MakeForAllAlphas(const PrincipledTableOptions& options);
};

// The constants of a principled material, and the tables it refers to.
struct PrincipledSurface {
  FresnelRise rise;
  bool thin = false;
  bool turned = false;  // The anisotropy's axes are not dp/du and dp/dv.
  SinCosPair<float> turn{0, 1};
  float coat_eta = 1.5f;
  Ggx coat;
  MuCurve coat_albedo;
  Sheen sheen;
  bool has_sheen = false;
  bool has_film = false;
  ThinFilm film;
  const PrincipledTable* table = nullptr;  // Never null where a Bsdf refers to it.
};

// The albedo of a coat's interface; 0 for index 1.
MuCurve CoatAlbedo(const Ggx& ggx, float eta);

}  // namespace sheaf::render
