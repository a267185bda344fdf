// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DiskSpace: how much a file system holds, and how much of that may still be written.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace sheaf {

struct DiskSpace {
  uint64_t available_bytes = 0;  // To this user.
  uint64_t capacity_bytes = 0;
};

// The space of a path's file system. Absent if it is not known.
std::optional<DiskSpace> DiskSpaceOf(const std::string& path);

// bytes, but at most 1 / fraction of the file system, so that small ones are not kept empty.
uint64_t AtMostFractionOf(const DiskSpace& space, uint64_t fraction, uint64_t bytes);

}  // namespace sheaf
