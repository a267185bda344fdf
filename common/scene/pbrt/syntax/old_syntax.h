// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Detects scene files written for pbrt-v3, whose names pbrt-v4 has changed. The advice is printed
// once, before the many errors that follow from it.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "common/scene/pbrt/syntax/parameter_list.h"

namespace sheaf {

// The outdated name in a directive, as the file writes it (Film "image"); empty if there is none.
// type: the quoted word after the directive; for textures, their class.
std::string OldSyntaxIn(std::string_view directive, const std::string& type,
                        const std::vector<Parameter>& parameters);
// Whether pbrt-v3 declared parameters with this type ("color Kd") and pbrt-v4 does not.
bool IsOldParameterType(std::string_view type);
// "this is pbrt-v3 (Film "image"): ...", including what to do.
std::string OldSyntaxAdvice(std::string_view sign);

}  // namespace sheaf
