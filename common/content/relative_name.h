// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Untrusted names of files within a folder: those of an upload, or in an archive.
#pragma once

#include <cstddef>
#include <string_view>

#include "absl/status/status.h"

namespace sheaf {

inline constexpr size_t kRelativeNameBytesMax = 1024;
inline constexpr size_t kRelativeNamePartBytesMax = 255;  // NAME_MAX of Linux.
inline constexpr size_t kRelativeNamePartsMax = 32;

// Whether the name leads to a file below the folder wherever the folder is: parts of printable
// UTF-8 with "/" between them, none of them empty, "." or "..", and without "\". Errors:
// kInvalidArgument, with the name and the reason.
absl::Status CheckRelativeName(std::string_view name);

}  // namespace sheaf
