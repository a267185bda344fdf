// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Rephrases file errors with the scene's names: a worker reads files from its cache, whose paths
// mean nothing to users.
#pragma once

#include <string>

#include "absl/status/status.h"

namespace sheaf {

// The same error with the message's path replaced by the scene's name for the file.
absl::Status NamedAsInScene(const absl::Status& status, const std::string& local_path,
                            const std::string& canonical_name);

}  // namespace sheaf
