// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Sheaf's own parameter of shapes and lights: "string invisible", the kinds of rays that do not see
// them.
#pragma once

#include "common/scene/pbrt/syntax/parameter_list.h"
#include "common/scene/ray_kinds.h"

namespace sheaf {

// 0 if the parameter is absent. Unknown and repeated words are reported.
RayKinds GetInvisible(ParameterList& parameters);

}  // namespace sheaf
