// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/bsdf.h"

#include "worker/render/bsdf_inl.h"
#include "worker/render/variant_list.h"

namespace sheaf::render {

#define SHEAF_INSTANTIATE_BSDF(name, traits)                                                      \
  template std::optional<BsdfSample> SampleBsdf<traits>(const Bsdf& bsdf, Vec3f wo, float u_lobe, \
                                                        Vec2f u);                                 \
  template BsdfValue EvalBsdf<traits>(const Bsdf& bsdf, Vec3f wo, Vec3f wi);
SHEAF_RENDER_VARIANTS(SHEAF_INSTANTIATE_BSDF)
#undef SHEAF_INSTANTIATE_BSDF

}  // namespace sheaf::render
