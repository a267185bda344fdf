// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MemoryRoom: how much memory this process may still allocate, and the limit that decides it: that
// of its address space (ulimit -v), that of a control group (containers, batch systems), or the
// machine's free memory.
#pragma once

#include <cstdint>
#include <string>

namespace sheaf {

struct MemoryRoom {
  uint64_t bytes = UINT64_MAX;
  std::string limit;  // "the limit of address space (ulimit -v, 900 MiB)"; empty: none is known.
};

// The smallest room of all limits. The default folders are Linux's; tests pass others.
// address_space_max: RLIMIT_AS in bytes, UINT64_MAX if there is none.
MemoryRoom FindMemoryRoom(uint64_t address_space_max, const std::string& proc = "/proc",
                          const std::string& cgroup = "/sys/fs/cgroup");
// For this process, now.
MemoryRoom FindMemoryRoom();

// "1.5 GiB", "900 MiB", "1 KiB", "12 bytes".
std::string FormatMemory(uint64_t bytes);

}  // namespace sheaf
