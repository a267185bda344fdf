// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Principled surfaces: sheen on a coat on a base, which is a mixture of metal, of an opaque
// dielectric (a reflection over a Lambertian body) and of glass, solid or a thin sheet. Directions
// come with wo.z > 0; `inside` matters to solid glass alone.
//
// Energy. The light that single scattering loses of each part comes back in a lobe of its own, as
// for conductors and dielectrics (energy_table.h). The body of an opaque dielectric gets what its
// reflection leaves, (1 - R(o)) (1 - R(i)) / (1 - average R), so that white under any reflection
// stays white. Sheen and coat leave to what is below them what they do not scatter towards wo:
// exact in a furnace, however rough the layers are.
// Reciprocity: each part of the base is reciprocal; a base under a rough coat or sheen is not,
// since the layers are taken off on the side of wo alone. Delta lobes are, so that paths from
// either end find the same light; and so are their probabilities, which two_ends.h requires.
// Sources: Kulla and Conty 2017, "Revisiting Physically Based Shading at Imageworks"; Kelemen and
// Szirmay-Kalos 2001 (the body); Estevez and Kulla 2017 (sheen over albedo scaling); the glTF
// extensions KHR_materials_clearcoat, _sheen, _specular, _ior, _transmission, _volume,
// _iridescence and _anisotropy; Burley 2015, "Extending the Disney BRDF".
#pragma once

#include <optional>

#include "worker/render/bsdf/bsdf.h"
#include "worker/render/bsdf/bsdf_sampling.h"
#include "worker/render/bsdf/lobe.h"
#include "worker/render/bsdf/principled_at.h"
#include "worker/render/bsdf/principled_glass.h"

namespace sheaf::render {

struct PrincipledLobe : LobeBase {
  using Material = PrincipledMaterial;
  static constexpr BsdfKind kKind = BsdfKind::kPrincipled;
  static constexpr TraitBits kTraits = TraitSet(Trait::kPrincipled);
  static constexpr bool kTransmits = true;
  static bool MayCross(const BsdfShape& bsdf) {
    return bsdf.base.transmission > 0 && bsdf.base.metallic < 1;
  }

  template <typename Color>
  static BsdfValueOf<Color> f(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi, bool inside) {
    if (bsdf.specular) return {};
    return PrincipledAt<Color>(bsdf, ToAxes(bsdf, wo), inside).Eval(ToAxes(bsdf, wi));
  }

  template <typename Color>
  static std::optional<BsdfSampleOf<Color>> Sample_f(const BsdfOf<Color>& bsdf, Vec3f wo,
                                                     float u_lobe, Vec2f u, bool inside) {
    std::optional<BsdfSampleOf<Color>> sample =
        PrincipledAt<Color>(bsdf, ToAxes(bsdf, wo), inside).Sample(u_lobe, u);
    if (!sample || !bsdf.principled->turned) return sample;
    const SinCosPair<float> turn = bsdf.principled->turn;
    const Vec3f w = sample->wi;
    sample->wi = {turn.cos * w.x - turn.sin * w.y, turn.sin * w.x + turn.cos * w.y, w.z};
    if ((sample->flags & kBsdfSpecular) == 0) {
      // The turn rounds: value and pdf are those of the direction that is returned.
      return FinishSample(f(bsdf, wo, sample->wi, inside), sample->wi, sample->flags,
                          sample->eta_scale);
    }
    return sample;
  }

  // The part of f that the body and the sheen scatter.
  template <typename Color>
  static Color DiffusePart(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi, bool inside) {
    return PrincipledAt<Color>(bsdf, ToAxes(bsdf, wo), inside).DiffusePart(ToAxes(bsdf, wi));
  }

  template <typename Color>
  static float PDF(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi, bool inside) {
    return f(bsdf, wo, wi, inside).pdf;
  }

 private:
  // From dp/du and dp/dv to the axes of the anisotropy.
  static Vec3f ToAxes(const BsdfShape& bsdf, Vec3f w) {
    if (!bsdf.principled->turned) return w;
    const SinCosPair<float> turn = bsdf.principled->turn;
    return {turn.cos * w.x + turn.sin * w.y, turn.cos * w.y - turn.sin * w.x, w.z};
  }
};

}  // namespace sheaf::render
