// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/surroundings/disk_space.h"

#include <sys/statvfs.h>

#include <algorithm>

namespace sheaf {

std::optional<DiskSpace> DiskSpaceOf(const std::string& path) {
  struct statvfs found {};
  if (::statvfs(path.c_str(), &found) != 0 || found.f_blocks == 0) return std::nullopt;
  const uint64_t block = found.f_frsize;
  return DiskSpace{block * found.f_bavail, block * found.f_blocks};
}

uint64_t AtMostFractionOf(const DiskSpace& space, uint64_t fraction, uint64_t bytes) {
  return std::min(bytes, space.capacity_bytes / fraction);
}

}  // namespace sheaf
