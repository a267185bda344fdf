// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What Shape "curve" says: Bezier curves or uniform B-splines of degree 2 or 3 as cubic segments.
#pragma once

#include "common/scene/curve_set.h"
#include "common/scene/pbrt/syntax/parameter_list.h"

namespace sheaf {

// Reads one curve. False (every problem reported) where it is none.
bool ReadCurve(ParameterList& parameters, CurveSet* curve);

}  // namespace sheaf
