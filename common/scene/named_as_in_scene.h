// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Errors of files in the words of the scene: a worker reads them from its cache, where their paths
// mean nothing to people.
#pragma once

#include <string>

#include "absl/status/status.h"

namespace sheaf {

// The same error with the scene's name for the file where the message has its path.
absl::Status NamedAsInScene(const absl::Status& status, const std::string& local_path,
                            const std::string& canonical_name);

}  // namespace sheaf
