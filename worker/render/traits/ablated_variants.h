// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Variants of the list with one trait compiled out that they carry for the sake of other scenes.
// Nothing renders with them: tests/cost counts what carrying the trait costs a scene without it.
// Traits that are not here are in no variant that a scene without them runs.
#pragma once

#include <cstdint>

#include "worker/render/traits/variant_list.h"

namespace sheaf::render {

constexpr uint32_t CommonWithout(Trait trait) { return kCommonTraits & ~TraitSet(trait); }

}  // namespace sheaf::render

// X(name of the trait in the plan, traits of the variant without it).
#define SHEAF_ABLATED_VARIANTS(X)                                                                  \
  X("textures", ::sheaf::render::CommonWithout(::sheaf::render::Trait::kTextures))                 \
  X("delta lights", ::sheaf::render::CommonWithout(::sheaf::render::Trait::kDeltaLights))          \
  X("area lights", ::sheaf::render::CommonWithout(::sheaf::render::Trait::kAreaLights))            \
  X("transmission", ::sheaf::render::CommonWithout(::sheaf::render::Trait::kSpecularTransmission)) \
  X("layered materials", ::sheaf::render::CommonWithout(::sheaf::render::Trait::kLayered))         \
  X("microfacets", ::sheaf::render::CommonWithout(::sheaf::render::Trait::kMicrofacet))            \
  X("instances", ::sheaf::render::CommonWithout(::sheaf::render::Trait::kInstances))               \
  X("curved shapes", ::sheaf::render::CommonWithout(::sheaf::render::Trait::kQuadrics))
