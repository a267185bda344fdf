// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The table of compiled variants for frames with chains.
#include "worker/render/chains/chain_variants.h"

#include <iterator>

#include "common/base/check.h"
#include "worker/render/traits/variant_list.h"

namespace sheaf::render {
namespace {

#define SHEAF_VARIANT_ENTRY(name, traits) &RenderRow<(traits), PathKind::kCameraWithChains>,
constexpr RenderRowFunction kChainRows[] = {SHEAF_CHAIN_VARIANTS(SHEAF_VARIANT_ENTRY)};
#undef SHEAF_VARIANT_ENTRY
#define SHEAF_VARIANT_ENTRY(name, traits) &TraceSeeds<(traits)>,
constexpr ChainSeedFunction kChainSeeds[] = {SHEAF_CHAIN_VARIANTS(SHEAF_VARIANT_ENTRY)};
#undef SHEAF_VARIANT_ENTRY

}  // namespace

RenderRowFunction ChainRowFunctionOf(size_t variant) {
  SHEAF_CHECK(variant < std::size(kChainRows));
  return kChainRows[variant];
}

ChainSeedFunction ChainSeedFunctionOf(size_t variant) {
  SHEAF_CHECK(variant < std::size(kChainSeeds));
  return kChainSeeds[variant];
}

}  // namespace sheaf::render
