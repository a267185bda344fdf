// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Frame ranges and file name patterns: "1-24", "1-100x5", "1,4,9-12" over "shot.####.pbrt".
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace sheaf::cli {

inline constexpr size_t kFramesMax = 100'000;

// Numbers in ascending order, none twice. "A-BxS" takes every S-th number from A on.
// Errors: kInvalidArgument, saying what is wrong with the text.
absl::StatusOr<std::vector<int32_t>> ParseFrameRange(const std::string& text);

// Whether there is a run of '#' in the file name.
bool IsPattern(const std::string& path);

// Replaces the last run of '#' by the number, padded with zeros to the run's length.
// "shot.####.exr" and 7 make "shot.0007.exr". A path without '#' comes back as it is.
std::string ExpandPattern(const std::string& pattern, int32_t frame_number);

}  // namespace sheaf::cli
