// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// WishForLargePages: for large arrays that are read here and there, where address translation would
// be waited for at most reads.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdint>

namespace sheaf {

// Only a wish: where the system has no large pages to give, small ones serve. For memory that has
// not been touched.
inline void WishForLargePages(void* begin, size_t size_bytes) {
#ifdef MADV_HUGEPAGE
  const uintptr_t page = 4096;
  const uintptr_t first = (reinterpret_cast<uintptr_t>(begin) + page - 1) / page * page;
  const uintptr_t end = (reinterpret_cast<uintptr_t>(begin) + size_bytes) / page * page;
  if (first < end) madvise(reinterpret_cast<void*>(first), end - first, MADV_HUGEPAGE);
#endif
}

}  // namespace sheaf
