// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The limit on files that a process may hold open.
#pragma once

#include <cstdint>

namespace sheaf {

// Raises the soft limit of open files (often 1,024, for programs that call select) to the hard one,
// and returns it. A worker with 64 scenes in memory may hold 100 open textures of each; a
// coordinator has a socket for each of thousands of workers. Leaves the limit unchanged on failure.
uint64_t RaiseOpenFileLimit();

}  // namespace sheaf
