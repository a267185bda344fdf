// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CPU time, which measures the cost of work independently of the machine's other load.
#pragma once

#include <ctime>

namespace sheaf {

// CPU time of the calling thread so far, seconds; 0 if it is not available.
inline double ThreadCpuSeconds() {
  timespec now{};
  if (clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now) != 0) return 0;
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace sheaf
