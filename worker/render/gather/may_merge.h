// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MayMerge: whether light paths are merged at a surface with this BSDF.
#pragma once

#include <algorithm>

#include "worker/render/bsdf/bsdf_inl.h"
#include "worker/render/gather/merging.h"

namespace sheaf::render {

// False for lobes that are too narrow for a blur, for hair, and for rough glass, whose other side
// may be another medium.
template <TraitBits kTraits>
bool MayMerge(const BsdfShape& bsdf) {
  switch (bsdf.kind) {
    case BsdfKind::kDiffuse:
    case BsdfKind::kDiffuseTransmission:
    case BsdfKind::kCoatedDiffuse:
    case BsdfKind::kMeasured:
      return true;
    case BsdfKind::kConductor:
    case BsdfKind::kCoatedConductor:
      return std::min(bsdf.alpha_x, bsdf.alpha_y) >= kMergeAlphaMin;
    case BsdfKind::kPrincipled: {
      constexpr float kMetallicMax = 0.5f;
      if (Transmits<kTraits>(bsdf)) return false;
      return bsdf.base.metallic < kMetallicMax ||
             std::min(bsdf.alpha_x, bsdf.alpha_y) >= kMergeAlphaMin;
    }
    default:
      return false;
  }
}

}  // namespace sheaf::render
