// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ProcessMemory: the memory that this process has now, as the system and the allocator say.
#pragma once

#include <cstdint>
#include <string_view>

namespace sheaf {

// Pages in memory, as the system counts them; both 0 where it does not say.
struct ResidentMemory {
  uint64_t bytes = 0;       // All: VmRSS.
  uint64_t file_bytes = 0;  // The part in mapped files: the program, its libraries, their data.
};
// The text of /proc/PID/smaps, of which other lines are skipped.
ResidentMemory ResidentMemoryOf(std::string_view smaps);

struct ProcessMemory {
  ResidentMemory resident;
  // The allocator's, of all threads: in use, and freed but kept. Some of the latter may not be in
  // memory.
  uint64_t heap_used_bytes = 0, heap_free_bytes = 0;
};
// Takes milliseconds, as the system walks all pages.
ProcessMemory ProcessMemoryNow();
// ResidentMemory::bytes alone, in microseconds.
uint64_t ResidentBytesNow();

}  // namespace sheaf
