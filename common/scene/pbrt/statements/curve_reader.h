// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Reads Shape "curve": Bezier curves or uniform B-splines of degree 2 or 3, converted to cubic
// segments.
#pragma once

#include "common/scene/curve_set.h"
#include "common/scene/pbrt/syntax/parameter_list.h"

namespace sheaf {

// Reads one curve. False (every problem is reported) if the parameters do not give one.
bool ReadCurve(ParameterList& parameters, CurveSet* curve);

}  // namespace sheaf
