// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Signs that a scene file is written for pbrt-v3, whose names pbrt-v4 has changed. Who opens such a
// file is told so first, and once, before the many errors that follow from it.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "common/scene/pbrt/syntax/parameter_list.h"

namespace sheaf {

// The sign in a directive, as the file writes it (Film "image"); empty where there is none. type:
// what stands in quotation marks after the directive, of textures their class.
std::string OldSyntaxIn(std::string_view directive, const std::string& type,
                        const std::vector<Parameter>& parameters);
// Whether parameters were declared so ("color Kd") and are no longer.
bool IsOldParameterType(std::string_view type);
// "this is pbrt-v3 (Film "image"): ...", with what to do.
std::string OldSyntaxAdvice(std::string_view sign);

}  // namespace sheaf
