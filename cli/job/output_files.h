// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Checks of the files that a command writes, made before any work begins: their names are valid,
// they are writable, and none is an input. Also fallback places for a finished file that cannot be
// written to its path.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"

namespace sheaf::cli {

// Whether the path ends in ".png", in lower or upper case.
bool IsPng(const std::string& path);
// flag: the option that gives the path, for messages. An empty path is OK: nothing is written.
// Errors: kInvalidArgument if the path ends otherwise, since the name would misstate the content.
absl::Status CheckOutputName(const std::string& flag, const std::string& path,
                             const std::vector<std::string>& endings);

// Ignores empty paths and inputs that do not exist. Errors: kInvalidArgument if an output is an
// input, by any name, or another output; those of CheckWritable.
absl::Status CheckOutputs(const std::vector<std::string>& outputs,
                          const std::vector<std::string>& inputs);

// Writes to path or, if that fails, to a temporary folder, $HOME or the working directory. Errors:
// kFailedPrecondition if write(path) fails: why, and where the file is kept instead.
absl::Status WriteOrKeep(const std::string& path,
                         const std::function<absl::Status(const std::string& path)>& write);

}  // namespace sheaf::cli
