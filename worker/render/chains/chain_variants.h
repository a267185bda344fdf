// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The compiled variants of the integrator for frames with chains.
#pragma once

#include <cstddef>
#include <cstdint>

#include "worker/render/integrator/variants.h"
#include "worker/render/scene/chain_seeds.h"

namespace sheaf::render {

// As RowFunctionOf. variant: an index in AllChainVariants().
RenderRowFunction ChainRowFunctionOf(size_t variant);
// Traces the light paths that leave seeds for chains: a pure function of the scene.
template <TraitBits kTraits>
ChainSeeds TraceSeeds(const CompiledScene& scene);
using ChainSeedFunction = ChainSeeds (*)(const CompiledScene& scene);
ChainSeedFunction ChainSeedFunctionOf(size_t variant);

}  // namespace sheaf::render
