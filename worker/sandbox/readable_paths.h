// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What a scene's process may read besides the files of its scene: the program's libraries, which
// are loaded when a scene first needs them.
#pragma once

#include <string>
#include <vector>

namespace sheaf::worker {

// Absolute paths that exist: the system's library folders, those of LD_LIBRARY_PATH, the dynamic
// linker's cache, Debian's alternatives, and the modules that read images and volumes.
std::vector<std::string> LibraryPaths();

}  // namespace sheaf::worker
