// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Sets of traits as bits, the parameter that what is compiled for a scene's needs is templated
// over.
#pragma once

#include <cstdint>

#include "worker/render/render_plan.h"

namespace sheaf::render {

constexpr bool Has(uint32_t traits, Trait trait) {
  return (traits & static_cast<uint32_t>(trait)) != 0;
}
constexpr uint32_t TraitSet() { return 0; }
template <typename... Rest>
constexpr uint32_t TraitSet(Trait first, Rest... rest) {
  return static_cast<uint32_t>(first) | TraitSet(rest...);
}

// Those for which a path knows what it is in.
inline constexpr uint32_t kInsides =
    TraitSet(Trait::kMedia, Trait::kSubsurface, Trait::kNestedDielectrics);

// Every trait a scene may call for, with colour as RGB and as spectra.
inline constexpr uint32_t kAllSpectralTraits = ~0u;
inline constexpr uint32_t kAllTraits = kAllSpectralTraits & ~TraitSet(Trait::kSpectral);

}  // namespace sheaf::render
