// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Files that people take for scenes and that are none in pbrt's format: what they are, told by how
// they begin and what they are called, and how they come in.
#pragma once

#include <string>

#include "absl/status/status.h"

namespace sheaf::cli {

// head: the file's first bytes. Errors: kInvalidArgument where it is known to be something else;
// the message begins with the path. What is merely wrong in a pbrt scene is the reader's to say.
absl::Status CheckSceneFormat(const std::string& path, const std::string& head);
// The same of a file. What cannot be read is the reader's to say, too.
absl::Status CheckSceneFormatOf(const std::string& path);

}  // namespace sheaf::cli
