// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Looks at the header of an image file before a library opens it.
#pragma once

#include <string>

#include "absl/status/status.h"

namespace sheaf {

// Checks the formats for which libraries take the memory that a header claims as soon as they open
// the file: EXR, GIF, JPEG 2000, and the chunks of PNG, whose library also prints a line about
// sizes of its own. The sizes of the others are checked once they are open. Errors: kNotFound;
// kInvalidArgument beyond the limits (image_limits.h) and for a header of an EXR that is malformed.
// Messages begin with the path.
absl::Status CheckImageHeader(const std::string& path);

}  // namespace sheaf
