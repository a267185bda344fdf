// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Interfaces: invisible surfaces that bound a medium. Rays pass straight through.
#pragma once

#include <optional>

#include "worker/render/bsdf/bsdf.h"
#include "worker/render/bsdf/lobe.h"

namespace sheaf::render {

struct InterfaceLobe : LobeBase {
  using Material = InterfaceMaterial;
  static constexpr BsdfKind kKind = BsdfKind::kInterface;
  static constexpr TraitBits kTraits = TraitSet(Trait::kAlpha);

  // A delta lobe: f and PDF are 0.
  template <typename Color>
  static BsdfValueOf<Color> f(const BsdfOf<Color>&, Vec3f /*wo*/, Vec3f /*wi*/, bool /*inside*/) {
    return {};
  }

  template <typename Color>
  static std::optional<BsdfSampleOf<Color>> Sample_f(const BsdfOf<Color>&, Vec3f wo,
                                                     float /*u_lobe*/, Vec2f /*u*/,
                                                     bool /*inside*/) {
    return BsdfSampleOf<Color>{
        .wi = -wo, .weight = Color::Gray(1), .flags = kBsdfSpecular | kBsdfTransmission};
  }

  template <typename Color>
  static float PDF(const BsdfOf<Color>&, Vec3f /*wo*/, Vec3f /*wi*/, bool /*inside*/) {
    return 0;
  }
};

}  // namespace sheaf::render
