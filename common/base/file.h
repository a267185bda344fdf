// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Whole files, written durably: once WriteFileAtomically returns OK, the file survives kill -9 and
// power loss.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace sheaf {

// The file to which path leads, following symbolic links, also to a file that does not exist yet.
// Errors: kFailedPrecondition if it leads to a directory, a device or anything else but a regular
// file.
absl::StatusOr<std::string> FollowToFile(const std::string& path);
// Writes FILE.tmp-PID-N beside the FILE that FollowToFile returns, fsyncs it, renames it to FILE,
// fsyncs the directory.
// Errors: also those of FollowToFile.
absl::Status WriteFileAtomically(const std::string& path, std::string_view bytes);
// The same for a file that only its owner may read.
absl::Status WriteSecretAtomically(const std::string& path, std::string_view bytes);
// OK if WriteFileAtomically could start now: creates and removes an empty file beside path.
absl::Status CheckWritable(const std::string& path);
// Creates or replaces the file. May leave a partial file if it fails or the machine stops.
absl::Status WriteFileOnce(const std::string& path, std::string_view bytes);
// Errors: kNotFound; kResourceExhausted beyond size_bytes_max.
absl::StatusOr<std::string> ReadWholeFile(const std::string& path,
                                          uint64_t size_bytes_max = uint64_t{1} << 34);
absl::Status MakeDirectories(const std::string& path);
// Makes a directory that only its owner may enter, or closes an existing one to others.
absl::Status MakePrivateDirectory(const std::string& path);

}  // namespace sheaf
