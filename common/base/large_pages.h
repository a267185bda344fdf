// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// AdviseHugePages: for large arrays with random reads, most of which would otherwise miss the
// translation lookaside buffer.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdint>

namespace sheaf {

// A hint: if the system has no large pages, small ones are used. Requires: the memory has not been
// touched yet.
inline void AdviseHugePages(void* begin, size_t size_bytes) {
#ifdef MADV_HUGEPAGE
  const uintptr_t page = 4096;
  const uintptr_t first = (reinterpret_cast<uintptr_t>(begin) + page - 1) / page * page;
  const uintptr_t end = (reinterpret_cast<uintptr_t>(begin) + size_bytes) / page * page;
  if (first < end) madvise(reinterpret_cast<void*>(first), end - first, MADV_HUGEPAGE);
#endif
}

}  // namespace sheaf
