// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/bsdf/glossy_part.h"

#include <algorithm>

#include "worker/render/bsdf/conductor_coat_table.h"
#include "worker/render/bsdf/energy_table.h"
#include "worker/render/bsdf/fresnel.h"
#include "worker/render/bsdf/microfacet.h"
#include "worker/render/bsdf/principled_shares.h"

namespace sheaf::render {
namespace {

struct Lobe {
  Ggx ggx;
  float reflectance = 0;
  float widening = 1;  // The width outside over the one of ggx.
};

// Delta lobes do not count.
GlossyPart PartOf(const Lobe& a, const Lobe& b, float diffuse) {
  const auto counted = [](const Lobe& lobe) { return lobe.ggx.IsSmooth() ? 0 : lobe.reflectance; };
  const float of_a = counted(a), of_b = counted(b);
  const Lobe& more = of_a > of_b ? a : b;
  GlossyPart part;
  part.glossy = std::max(of_a, of_b);
  part.diffuse = diffuse + std::min(of_a, of_b);
  if (part.glossy > 0) {
    part.alpha = std::clamp(EquivalentAlpha(more.ggx) * more.widening, kSmoothAlpha, 1.0f);
  }
  return part;
}

template <typename Color>
GlossyPart PartOfCoatedDiffuse(const BsdfOf<Color>& bsdf, float cosine) {
  const float coat = FresnelDielectric(cosine, bsdf.eta).reflectance;
  return PartOf({{bsdf.alpha_x, bsdf.alpha_y}, coat}, {}, (1 - coat) * MeanComponent(bsdf.color));
}

template <typename Color>
GlossyPart PartOfCoatedConductor(const BsdfOf<Color>& bsdf, float cosine) {
  if (bsdf.specular) return {};
  const ConductorCoatRow& row = *bsdf.conductor_coat;
  const MuPosition o = FindMu(cosine);
  const float inner = FresnelDielectric(cosine, bsdf.eta).cos_t, bend = row.bend.At(o);
  const float base =
      MeanComponent(FresnelConductor(std::min(1.0f, inner), bsdf.conductor_eta, bsdf.conductor_k));
  // The interface turns directions inside by more outside.
  const Lobe highlight{row.LobeAt(bend, bend), row.highlight.At(o) * base,
                       std::max(1.0f, bsdf.eta)};
  return PartOf({{bsdf.alpha_x, bsdf.alpha_y}, row.reflect.At(o)}, highlight,
                row.rest_albedo.At(o) * MeanComponent(bsdf.color));
}

template <typename Color>
GlossyPart PartOfPrincipled(const BsdfOf<Color>& bsdf, float cosine) {
  const PrincipledSurface& surface = *bsdf.principled;
  const float metal = bsdf.base.metallic;
  if ((1 - metal) * bsdf.base.transmission > 0) return {};
  const PrincipledShares<Color> shares(bsdf);
  const float coat = bsdf.top.coat == 0
                         ? 0
                         : bsdf.top.coat * FresnelDielectric(cosine, surface.coat_eta).reflectance;
  const float dielectric = MeanComponent(shares.Dielectric(cosine));
  float base = (1 - metal) * dielectric;
  if (metal > 0) base += metal * MeanComponent(shares.Metal(cosine));
  const float body = (1 - metal) * (1 - dielectric) * MeanComponent(bsdf.color);
  return PartOf({surface.coat, coat}, {{bsdf.alpha_x, bsdf.alpha_y}, (1 - coat) * base},
                (1 - coat) * body);
}

}  // namespace

template <typename Color>
GlossyPart GlossyPartOf(const BsdfOf<Color>& bsdf, Vec3f wo) {
  const float cosine = std::min(1.0f, wo.z);
  switch (bsdf.kind) {
    case BsdfKind::kConductor:
      return PartOf({{bsdf.alpha_x, bsdf.alpha_y}, 1}, {}, 0);
    case BsdfKind::kCoatedDiffuse:
      return PartOfCoatedDiffuse(bsdf, cosine);
    case BsdfKind::kCoatedConductor:
      return PartOfCoatedConductor(bsdf, cosine);
    case BsdfKind::kPrincipled:
      return PartOfPrincipled(bsdf, cosine);
    default:
      return {};
  }
}

template GlossyPart GlossyPartOf<Rgb>(const BsdfOf<Rgb>&, Vec3f);
template GlossyPart GlossyPartOf<Spectral>(const BsdfOf<Spectral>&, Vec3f);

}  // namespace sheaf::render
