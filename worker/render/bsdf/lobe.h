// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LobeBase, LobeList: a lobe is one model of scattering, a struct of static members in a header of
// its own; lobes.h lists them all. Every lobe derives from LobeBase and has
//   using Material: the material of a scene whose surfaces scatter so.
//   static constexpr BsdfKind kKind: which Bsdfs are of this lobe.
//   f(bsdf, wo, wi, inside): f(wo, wi) * |cos wi| and the pdf of Sample_f; 0 for delta lobes.
//   Sample_f(bsdf, wo, u_lobe, u, inside): a direction; as SampleBsdf. Unless it is of a delta
//     lobe, its pdf is f's, to the bit.
//   PDF(bsdf, wo, wi, inside): the density of Sample_f alone, over solid angle.
// all templates over the color. Directions come with wo.z > 0: where wo is on the -z side of the
// surface, both were mirrored in z, and `inside` is true.
#pragma once

#include <cstdint>
#include <type_traits>

#include "common/scene/material_description.h"
#include "worker/render/bsdf/bsdf.h"
#include "worker/render/traits/trait_set.h"

namespace sheaf::render {

struct LobeBase {
  // Variants with all of these compile the lobe; in others its Bsdfs are black. 0: every variant.
  static constexpr TraitBits kTraits = 0;
  // Without sides, directions are not mirrored: wo may be on either side, and `inside` is false.
  static constexpr bool kHasSides = true;
  // Whether light may leave on the other side than wo's, straight through interfaces excepted.
  static constexpr bool kTransmits = false;
  // Whether it does for this Bsdf, of a lobe of which it may.
  static bool MayCross(const BsdfShape&) { return true; }
};

template <typename... Lobes>
struct LobeList;

// The lobe of a list whose material it is.
template <typename Material, typename List>
struct LobeOfMaterial;
template <typename Material>
struct LobeOfMaterial<Material, LobeList<>> {};
template <typename Material, typename First, typename... Rest>
struct LobeOfMaterial<Material, LobeList<First, Rest...>>
    : std::conditional_t<std::is_same_v<Material, typename First::Material>,
                         std::type_identity<First>, LobeOfMaterial<Material, LobeList<Rest...>>> {};

template <typename... Lobes>
struct LobeList {
  // visit(Lobe{}) for the lobe of this kind; Result{} where a variant with kTraits has none.
  template <TraitBits kTraits, typename Result, typename Visit>
  [[gnu::always_inline]] static Result Choose(BsdfKind kind, const Visit& visit) {
    return ChooseAmong<kTraits, Result, Visit, Lobes...>(kind, visit);
  }

 private:
  // A chain of comparisons that returns from each branch; compilers make a switch of it.
  template <TraitBits kTraits, typename Result, typename Visit, typename First, typename... Rest>
  [[gnu::always_inline]] static Result ChooseAmong(BsdfKind kind, const Visit& visit) {
    if constexpr ((kTraits & First::kTraits) == First::kTraits) {
      if (kind == First::kKind) return visit(First{});
    }
    if constexpr (sizeof...(Rest) > 0) {
      return ChooseAmong<kTraits, Result, Visit, Rest...>(kind, visit);
    }
    return Result{};
  }
};

}  // namespace sheaf::render
