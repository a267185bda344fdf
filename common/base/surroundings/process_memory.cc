// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/surroundings/process_memory.h"

#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <string>

#include "absl/status/statusor.h"
#include "common/base/file.h"

namespace sheaf {
namespace {

// A mapping takes some 800 bytes, and a process has at most 65,530 by default.
constexpr uint64_t kSmapsBytesMax = uint64_t{64} << 20;

// The number of bytes of "Rss:      12 kB"; 0 for other lines.
uint64_t ResidentBytesOfLine(std::string_view line) {
  constexpr std::string_view kName = "Rss:";
  if (!line.starts_with(kName)) return 0;
  const size_t digit = line.find_first_not_of(' ', kName.size());
  if (digit == std::string_view::npos) return 0;
  uint64_t kibibytes = 0;
  std::from_chars(line.data() + digit, line.data() + line.size(), kibibytes);
  return kibibytes << 10;
}

}  // namespace

ResidentMemory ResidentMemoryOf(std::string_view smaps) {
  ResidentMemory memory;
  bool is_file = false;
  while (!smaps.empty()) {
    const std::string_view line = smaps.substr(0, smaps.find('\n'));
    smaps.remove_prefix(std::min(smaps.size(), line.size() + 1));
    const size_t colon = line.find(':'), space = line.find(' ');
    // "7f00-7f01 r-xp 00000000 08:01 1234   /usr/lib/libc.so.6" begins a mapping.
    if (space != std::string_view::npos && space < colon) {
      is_file = line.find('/') != std::string_view::npos;
      continue;
    }
    const uint64_t bytes = ResidentBytesOfLine(line);
    memory.bytes += bytes;
    if (is_file) memory.file_bytes += bytes;
  }
  return memory;
}

uint64_t ResidentBytesNow() {
  unsigned long long all_pages = 0, resident_pages = 0;  // man 5 proc_pid_statm.
  std::FILE* const file = std::fopen("/proc/self/statm", "re");
  if (file == nullptr) return 0;
  const bool is_read = std::fscanf(file, "%llu %llu", &all_pages, &resident_pages) == 2;
  std::fclose(file);
  return is_read ? resident_pages * static_cast<uint64_t>(::sysconf(_SC_PAGESIZE)) : 0;
}

ProcessMemory ProcessMemoryNow() {
  ProcessMemory memory;
  const absl::StatusOr<std::string> smaps = ReadWholeFile("/proc/self/smaps", kSmapsBytesMax);
  if (smaps.ok()) memory.resident = ResidentMemoryOf(*smaps);
#ifdef __GLIBC__
  const struct mallinfo2 heap = mallinfo2();
  memory.heap_used_bytes = heap.uordblks + heap.hblkhd;
  memory.heap_free_bytes = heap.fordblks;
#endif
  return memory;
}

}  // namespace sheaf
