// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SHEAF_CHECK stops the process on a programming error, in every build type. The farm survives a
// crash: the lease expires and another worker takes the task. SHEAF_DCHECK is for tracing kernels
// only and is removed under NDEBUG.
#pragma once

namespace sheaf {
// Prints "file:line: check failed: expression" and aborts.
[[noreturn]] void CheckFailed(const char* file, int line, const char* expression);
}  // namespace sheaf

#define SHEAF_CHECK(condition) \
  ((condition) ? static_cast<void>(0) : ::sheaf::CheckFailed(__FILE__, __LINE__, #condition))

#ifdef NDEBUG
#define SHEAF_DCHECK(condition) static_cast<void>(0)
#else
#define SHEAF_DCHECK(condition) SHEAF_CHECK(condition)
#endif
