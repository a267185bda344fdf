// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LoadModule: loads a shared object of Sheaf that few runs need, so that others pay nothing for the
// libraries behind it.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace sheaf {

// Where modules and programs that others start are looked for: the program's own folder, or, in an
// installation, ../lib/sheaf beside it. Found by /proc at the first call: a process that gives up
// /proc calls this before.
const std::vector<std::string>& ModuleFolders();
// The path of the file in the first of the folders that has it; empty if none has.
std::string FindInFolders(const std::vector<std::string>& folders, const std::string& file);
// The symbol of the module in the first of the folders that has the file. Never unloaded.
// Errors: kFailedPrecondition if it is missing or incompatible: a phrase that says why.
absl::StatusOr<const void*> LoadModule(const std::vector<std::string>& folders,
                                       const std::string& file, const char* symbol);

}  // namespace sheaf
