// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A library preloaded into programs that simulates faults of the machine. The file named by
// SHEAF_TEST_FAULTS describes them and may change at any time. It holds two int64: the error of the
// wall clock in seconds (the steady clock stays correct, as when a machine's clock is set), and
// whether the disk is full.
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <ctime>

namespace {

struct Faults {
  int64_t clock_offset_seconds = 0, disk_full = 0;
};

const volatile Faults& MachineFaults() {
  static const volatile Faults* const faults = []() -> const volatile Faults* {
    static const Faults none;
    const char* path = std::getenv("SHEAF_TEST_FAULTS");
    const int file = path == nullptr ? -1 : ::open(path, O_RDONLY | O_CLOEXEC);
    if (file < 0) return &none;
    const void* mapped = ::mmap(nullptr, sizeof(Faults), PROT_READ, MAP_SHARED, file, 0);
    ::close(file);
    return mapped == MAP_FAILED ? &none : static_cast<const volatile Faults*>(mapped);
  }
  ();
  return *faults;
}

// Whether a write must fail: for all files but the log.
bool IsFull(int file) {
  struct stat info {};
  return MachineFaults().disk_full != 0 && file > STDERR_FILENO && ::fstat(file, &info) == 0 &&
         S_ISREG(info.st_mode);
}

ssize_t NoSpace() {
  errno = ENOSPC;
  return -1;
}

}  // namespace

extern "C" {

int clock_gettime(clockid_t clock, timespec* time) noexcept {
  const auto result = static_cast<int>(::syscall(SYS_clock_gettime, clock, time));
  if (result == 0 && clock == CLOCK_REALTIME) {
    time->tv_sec += MachineFaults().clock_offset_seconds;
  }
  return result;
}

ssize_t write(int file, const void* bytes, size_t count) {
  return IsFull(file) ? NoSpace() : ::syscall(SYS_write, file, bytes, count);
}

ssize_t pwrite(int file, const void* bytes, size_t count, off_t offset) {
  return IsFull(file) ? NoSpace() : ::syscall(SYS_pwrite64, file, bytes, count, offset);
}

ssize_t pwrite64(int file, const void* bytes, size_t count, off64_t offset) {
  return IsFull(file) ? NoSpace() : ::syscall(SYS_pwrite64, file, bytes, count, offset);
}

}  // extern "C"
