// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The files that a command writes: named right, writable and none of its inputs, which is known
// before any work begins; and where a finished file goes that cannot be written to its place.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"

namespace sheaf::cli {

// Whether the path ends so, in small letters or capitals.
bool IsPng(const std::string& path);
// flag: the option that names the path, for messages. An empty path is OK: nothing is written.
// Errors: kInvalidArgument where it ends otherwise, so that it would hold what it does not say.
absl::Status CheckOutputName(const std::string& flag, const std::string& path,
                             const std::vector<std::string>& endings);

// Empty paths are left out. Inputs that are not there are none.
// Errors: kInvalidArgument where an output is an input, by whatever name, or another output; those
// of CheckWritable.
absl::Status CheckOutputs(const std::vector<std::string>& outputs,
                          const std::vector<std::string>& inputs);

// Writes to path, or where that fails to a temporary folder, $HOME or the working directory.
// Errors: kFailedPrecondition where write(path) fails: why, and where it is kept instead.
absl::Status WriteOrKeep(const std::string& path,
                         const std::function<absl::Status(const std::string& path)>& write);

// For a command that a person shall copy: in single quotes where a shell would read it otherwise.
std::string ShellQuoted(const std::string& text);

}  // namespace sheaf::cli
