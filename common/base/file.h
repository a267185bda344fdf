// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Whole files, durably: what WriteFileAtomically returned OK for survives kill -9 and power loss.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace sheaf {

// Writes PATH.tmp-PID-N in the same directory, fsyncs it, renames it to path, fsyncs the directory.
absl::Status WriteFileAtomically(const std::string& path, std::string_view bytes);
// Makes or replaces it, and may leave some of it where that fails or the machine stops.
absl::Status WriteFileOnce(const std::string& path, std::string_view bytes);
// Errors: kNotFound; kResourceExhausted beyond size_bytes_max.
absl::StatusOr<std::string> ReadWholeFile(const std::string& path,
                                          uint64_t size_bytes_max = uint64_t{1} << 34);
absl::Status MakeDirectories(const std::string& path);

}  // namespace sheaf
