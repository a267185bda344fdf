// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Labels: the names that people give to shows, pools of workers and tags of workers.
#pragma once

#include <cstddef>
#include <string>

namespace sheaf {

inline constexpr size_t kLabelBytesMax = 64;

// Returns why the text is not a label (1 to kLabelBytesMax letters, digits, ".", "-", "_" or "@");
// empty if it is one.
std::string WhyNoLabel(const std::string& text);

}  // namespace sheaf
