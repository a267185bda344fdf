// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Recognizes files of other formats that are passed as scenes, by their first bytes and their
// names, and says how to convert them.
#pragma once

#include <string>

#include "absl/status/status.h"

namespace sheaf::cli {

// head: the file's first bytes. Errors: kInvalidArgument if the file has another known format; the
// message begins with the path. Errors within a pbrt scene are left to the scene reader.
absl::Status CheckSceneFormat(const std::string& path, const std::string& head);
// The same for a file. Files that cannot be read are left to the scene reader, too.
absl::Status CheckSceneFormatOf(const std::string& path);

}  // namespace sheaf::cli
