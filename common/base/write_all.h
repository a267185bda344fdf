// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// WriteAll: bytes to an open file.
#pragma once

#include <string>
#include <string_view>

#include "absl/status/status.h"

namespace sheaf {

// Writes all of the bytes, also where the system takes them in parts. path: for messages. Errors:
// those of StatusFromErrno; a part may have been written.
absl::Status WriteAll(int fd, std::string_view bytes, const std::string& path);

}  // namespace sheaf
