// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/open_files.h"

#include <sys/resource.h>

namespace sheaf {

uint64_t RaiseOpenFileLimit() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return 0;
  const rlim_t before = limit.rlim_cur;
  limit.rlim_cur = limit.rlim_max;
  return ::setrlimit(RLIMIT_NOFILE, &limit) == 0 ? limit.rlim_cur : before;
}

}  // namespace sheaf
