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

// The file that path leads to: symbolic links are followed, also to a file that is not there yet.
// Errors: kFailedPrecondition where a directory, a device or another thing than a regular file is.
absl::StatusOr<std::string> FollowToFile(const std::string& path);
// Writes FILE.tmp-PID-N beside the FILE that FollowToFile gives, fsyncs it, renames it to FILE,
// fsyncs the directory. Errors: also those of FollowToFile.
absl::Status WriteFileAtomically(const std::string& path, std::string_view bytes);
// OK where WriteFileAtomically could begin now: makes and removes an empty file beside path.
absl::Status CheckWritable(const std::string& path);
// Makes or replaces it, and may leave some of it where that fails or the machine stops.
absl::Status WriteFileOnce(const std::string& path, std::string_view bytes);
// Errors: kNotFound; kResourceExhausted beyond size_bytes_max.
absl::StatusOr<std::string> ReadWholeFile(const std::string& path,
                                          uint64_t size_bytes_max = uint64_t{1} << 34);
absl::Status MakeDirectories(const std::string& path);

}  // namespace sheaf
