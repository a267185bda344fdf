// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Only the coordinator's account may read the state directory. A coordinator creates all files
// there as private; earlier versions left most of them readable by others.
#pragma once

#include <cstddef>
#include <string>

namespace sheaf::coordinator {

// Files and folders that are closed in one start; some seconds on a disk that is not cached.
inline constexpr size_t kClosedEntriesMax = 1'000'000;

// Closes the directory to others, and once the files that an earlier version left open in it; other
// files stay as they are. Warns about files of another account, which cannot be closed.
void CloseStateDirectory(const std::string& directory, size_t entries_max = kClosedEntriesMax);

}  // namespace sheaf::coordinator
