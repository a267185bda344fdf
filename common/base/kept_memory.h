// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// KeepFreedMemory: for a process that allocates and frees blocks of megabytes all the time, as one
// that passes parts on. The C library returns such blocks to the system at once, and each use of
// the next one then costs page faults, which can take more time than the work itself.
#pragma once

#include <malloc.h>

namespace sheaf {

// Smaller blocks, and this many freed bytes at the end of each arena, stay with the process.
inline constexpr int kKeptFreeBytesMax = 32 << 20;

// Affects the whole process. Call it before the first thread starts. Without effect where the C
// library has no such setting.
inline void KeepFreedMemory() {
#ifdef M_MMAP_THRESHOLD
  mallopt(M_MMAP_THRESHOLD, kKeptFreeBytesMax);
  mallopt(M_TRIM_THRESHOLD, kKeptFreeBytesMax);
#endif
}

}  // namespace sheaf
