// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Frame ranges and file name patterns: "1-24", "1-100x5", "1,4,9-12" with "shot.####.pbrt".
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace sheaf::cli {

inline constexpr size_t kFramesMax = 100'000;

// Numbers in ascending order without duplicates. "A-BxS" means every S-th number from A to B.
// Errors: kInvalidArgument, saying what is wrong with the text.
absl::StatusOr<std::vector<int32_t>> ParseFrameRange(const std::string& text);

// The same as text: "1-3,7". Requires: ascending numbers.
std::string FormatFrameRange(const std::vector<int32_t>& numbers);

// Whether the file name contains a run of '#'.
bool IsPattern(const std::string& path);

// Replaces the last run of '#' by the number, padded with zeros to the run's length.
// "shot.####.exr" and 7 make "shot.0007.exr". A path without '#' is returned unchanged.
std::string ExpandPattern(const std::string& pattern, int32_t frame_number);

}  // namespace sheaf::cli
