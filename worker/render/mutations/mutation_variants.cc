// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The table of compiled variants for frames whose bright samples start chains of mutations.
#include "worker/render/mutations/mutation_variants.h"

#include <iterator>

#include "common/base/check.h"
#include "worker/render/traits/variant_list.h"

namespace sheaf::render {
namespace {

#define SHEAF_VARIANT_ENTRY(name, traits) &TraceMutationRow<(traits)>,
constexpr MutationRowFunction kMutationRows[] = {SHEAF_MUTATION_VARIANTS(SHEAF_VARIANT_ENTRY)};
#undef SHEAF_VARIANT_ENTRY

}  // namespace

MutationRowFunction MutationRowFunctionOf(size_t variant) {
  SHEAF_CHECK(variant < std::size(kMutationRows));
  return kMutationRows[variant];
}

}  // namespace sheaf::render
