// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/bsdf/bsdf.h"

#include "worker/render/bsdf/bsdf_inl.h"
#include "worker/render/traits/variant_list.h"

namespace sheaf::render {

#define SHEAF_INSTANTIATE_BSDF(name, traits)                                                   \
  template std::optional<BsdfSampleOf<ColorOf<(traits)>>> SampleBsdf<(traits)>(                \
      const BsdfOf<ColorOf<(traits)>>&, Vec3f, float, Vec2f);                                  \
  template BsdfValueOf<ColorOf<(traits)>> EvalBsdf<(traits)>(const BsdfOf<ColorOf<(traits)>>&, \
                                                             Vec3f, Vec3f);
SHEAF_RENDER_VARIANTS(SHEAF_INSTANTIATE_BSDF)
#undef SHEAF_INSTANTIATE_BSDF

}  // namespace sheaf::render
