// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Ablated variants: variants of the list without one trait that they include for the sake of other
// scenes. Nothing renders with them: tests/cost uses them to count the cost of the trait for scenes
// without it. Traits not listed here are in no variant that a scene without them uses.
#pragma once

#include <cstdint>

#include "worker/render/traits/variant_list.h"

namespace sheaf::render {

constexpr TraitBits CommonWithout(Trait trait) { return kCommonTraits & ~TraitSet(trait); }

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
  X("quadrics", ::sheaf::render::CommonWithout(::sheaf::render::Trait::kQuadrics))                 \
  X("vertex normals", ::sheaf::render::CommonWithout(::sheaf::render::Trait::kVertexNormals))
