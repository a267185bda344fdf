// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The end of a message about an unknown type: the nearest supported one, and all of them.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace sheaf {

// "; did you mean \"sphere\"?; supported: sphere, disk and curve". The question is left out if no
// name is close to `name`. Requires: names is not empty.
std::string SupportedNamesHint(std::string_view name, const std::vector<std::string>& names);

}  // namespace sheaf
