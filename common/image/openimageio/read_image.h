// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Whole images by OpenImageIO, for what is loaded with it.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "common/image/image_io.h"

namespace sheaf {

// ReadImage of a file that is there.
absl::StatusOr<FloatImage> ReadByOpenImageIO(const std::string& path,
                                             const ReadImageLimits& limits);

// A message of OpenImageIO, which come with line ends and sometimes not at all.
std::string OneLine(std::string text, const std::string& fallback);

}  // namespace sheaf
