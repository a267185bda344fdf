// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// UnpackZip: unpacks an untrusted zip file. The door to libarchive.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"

namespace sheaf::cli {

struct ZipLimits {
  uint64_t bytes_max = 0;  // All files together.
  uint32_t files_max = 0;
};
// Bytes of the files for each byte of the zip file, beyond the first kZipFreeBytes. Scenes as text
// compress by a factor of ten; zip bombs by hundreds.
inline constexpr uint64_t kZipRatioMax = 100;
inline constexpr uint64_t kZipFreeBytes = uint64_t{4} << 20;

// Unpacks into the folder, which exists and is empty. Names are those that CheckRelativeName
// allows. Notes of macOS (__MACOSX, .DS_Store) are left out. Errors: kInvalidArgument (not a zip
// file, damaged, encrypted, or with links or devices); kResourceExhausted (a limit, or the disk).
absl::Status UnpackZip(const std::string& path, const std::string& folder, const ZipLimits& limits);

}  // namespace sheaf::cli
