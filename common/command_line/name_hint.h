// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Suggests the name that a user meant by one that a program does not know.
#pragma once

#include <string>
#include <vector>

namespace sheaf {

// As NearestNameHint, but words that other programs use for what has another name here lead to
// ours, if it is among the names. Thread safety: pure.
std::string NameHint(const std::string& name, const std::vector<std::string>& names);

}  // namespace sheaf
