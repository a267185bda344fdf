// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Suggests the intended name for an unknown one: the nearest by single-byte edits.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace sheaf {

// "; did you mean \"radius\"?" if a candidate begins with the name or is close to it, otherwise "".
std::string NearestNameHint(std::string_view name, const std::vector<std::string>& candidates);

}  // namespace sheaf
