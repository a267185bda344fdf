// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The table of compiled variants for frames whose paths count in several pixels.
#include "worker/render/eyes/eye_variants.h"

#include <iterator>

#include "common/base/check.h"
#include "worker/render/traits/variant_list.h"

namespace sheaf::render {
namespace {

#define SHEAF_VARIANT_ENTRY(name, traits) &TraceEyeRow<(traits)>,
constexpr EyeRowFunction kEyeRows[] = {SHEAF_EYE_VARIANTS(SHEAF_VARIANT_ENTRY)};
#undef SHEAF_VARIANT_ENTRY

}  // namespace

EyeRowFunction EyeRowFunctionOf(size_t variant) {
  SHEAF_CHECK(variant < std::size(kEyeRows));
  return kEyeRows[variant];
}

}  // namespace sheaf::render
