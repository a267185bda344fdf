// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Finds the colors of an EXR image among its channels.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"

namespace sheaf {

// The places in `names` of gray, or of red, green and blue, with or without alpha: R, G, B and A of
// no layer or else of the only layer that has them; else Y; else the only channel. Empty if none of
// the channels has such a meaning.
std::vector<int> ColorChannelsOf(const std::vector<std::string>& names);

// The error for a file of such channels. The message begins with the path.
absl::Status NoColorChannels(const std::string& path, std::vector<std::string> names);

}  // namespace sheaf
