// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// AllowReadingOnly: Landlock, by which a process without privileges gives up access to files.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"

namespace sheaf::worker {

// From now on, this process and its threads to come can open only these files, and those below
// these folders, and only to read them. Below the folder `writable` (empty: none) files and folders
// can also be made, written and removed. The files `programs` can also be started. Open files stay
// open.
// Requires: no new privileges (PR_SET_NO_NEW_PRIVS); one thread.
// Errors: kUnavailable if the kernel has no Landlock or it is turned off.
absl::Status AllowReadingOnly(const std::vector<std::string>& paths,
                              const std::string& writable = "",
                              const std::vector<std::string>& programs = {});

}  // namespace sheaf::worker
