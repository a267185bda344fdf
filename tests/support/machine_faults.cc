// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A library preloaded into programs that simulates faults of the machine. The file named by
// SHEAF_TEST_FAULTS describes them (struct Faults; tests/integration/machine_faults.py writes it)
// and may change at any time.
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>

namespace {

// A named point at which the process is killed, once.
enum KillPoint : int64_t {
  kNever = 0,
  kBeforeRename = 1,  // A file is renamed to a path that contains kill_path.
  kAfterRename = 2,
  // The row of the first stored part is durable: the database's log has been synchronized since the
  // part's file was there.
  kAfterRow = 3,
  kBeforeGroup = 4,  // A group of parts is written, and about to be made durable together.
  kAfterGroup = 5,   // They are durable, and their rows are about to be committed.
};

struct Faults {
  // The error of the wall clock. The steady clock stays correct, as when a machine's clock is set.
  int64_t clock_offset_seconds = 0;
  // The error with which writes of regular files fail: ENOSPC, EIO or EROFS; 0: they succeed.
  int64_t write_error = 0;
  int64_t kill_point = kNever;
  char kill_path[64] = {};
};

const volatile Faults& MachineFaults() {
  static const volatile Faults* const faults = []() -> const volatile Faults* {
    static const Faults none;
    const char* path = std::getenv("SHEAF_TEST_FAULTS");
    const int file =
        path == nullptr
            ? -1
            : static_cast<int>(::syscall(SYS_openat, AT_FDCWD, path, O_RDONLY | O_CLOEXEC));
    if (file < 0) return &none;
    const void* mapped = ::mmap(nullptr, sizeof(Faults), PROT_READ, MAP_SHARED, file, 0);
    ::close(file);
    return mapped == MAP_FAILED ? &none : static_cast<const volatile Faults*>(mapped);
  }
  ();
  return *faults;
}

int WriteError() { return static_cast<int>(MachineFaults().write_error); }

// Whether a write must fail: for all files but the log.
bool WriteFails(int file) {
  struct stat info {};
  return WriteError() != 0 && file > STDERR_FILENO && ::fstat(file, &info) == 0 &&
         S_ISREG(info.st_mode);
}

int Fail(int error) {
  errno = error;
  return -1;
}

// On a disk that is read-only nothing is created, renamed or removed either.
bool IsReadOnly() { return WriteError() == EROFS; }

void KillAt(KillPoint point, const char* path) {
  const volatile Faults& faults = MachineFaults();
  if (faults.kill_point != point) return;
  const char* part = const_cast<const char*>(faults.kill_path);
  if (std::strstr(path, part) != nullptr) ::raise(SIGKILL);
}

std::atomic<bool> part_was_stored = false;

void NoteRename(const char* to) {
  if (MachineFaults().kill_point == kAfterRow && std::strstr(to, "/parts/") != nullptr) {
    part_was_stored = true;
  }
  KillAt(kAfterRename, to);
}

void NoteSync(int file) {
  if (!part_was_stored) return;
  char link[32], path[512] = {};
  std::snprintf(link, sizeof link, "/proc/self/fd/%d", file);
  if (::readlink(link, path, sizeof path - 1) < 0) return;
  if (std::strstr(path, "-wal") != nullptr) ::raise(SIGKILL);
}

int Synchronize(int64_t call, int file) {
  if (WriteError() == EIO && WriteFails(file)) return Fail(EIO);
  const auto result = static_cast<int>(::syscall(call, file));
  if (result == 0) NoteSync(file);
  return result;
}

int Open(int folder, const char* path, int flags, mode_t mode) {
  constexpr int kWrites = O_WRONLY | O_RDWR | O_CREAT | O_TRUNC;
  if (IsReadOnly() && (flags & kWrites) != 0 && std::strncmp(path, "/dev/", 5) != 0) {
    return Fail(EROFS);
  }
  return static_cast<int>(::syscall(SYS_openat, folder, path, flags, mode));
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

// OpenSSL reads the time of certificates by it.
time_t time(time_t* result) noexcept {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  if (result != nullptr) *result = now.tv_sec;
  return now.tv_sec;
}

ssize_t write(int file, const void* bytes, size_t count) {
  return WriteFails(file) ? Fail(WriteError()) : ::syscall(SYS_write, file, bytes, count);
}

ssize_t pwrite(int file, const void* bytes, size_t count, off_t offset) {
  return WriteFails(file) ? Fail(WriteError())
                          : ::syscall(SYS_pwrite64, file, bytes, count, offset);
}

ssize_t pwrite64(int file, const void* bytes, size_t count, off64_t offset) {
  return pwrite(file, bytes, count, offset);
}

int fsync(int file) { return Synchronize(SYS_fsync, file); }

// No regular file is named by it; the error is that of some file that could not be written.
int syncfs(int file) noexcept {
  KillAt(kBeforeGroup, "");
  if (WriteError() == EIO) return Fail(EIO);
  const auto result = static_cast<int>(::syscall(SYS_syncfs, file));
  if (result == 0) KillAt(kAfterGroup, "");
  return result;
}

int fdatasync(int file) { return Synchronize(SYS_fdatasync, file); }

int rename(const char* from, const char* to) noexcept {
  if (IsReadOnly()) return Fail(EROFS);
  KillAt(kBeforeRename, to);
  const auto result = static_cast<int>(::syscall(SYS_rename, from, to));
  if (result == 0) NoteRename(to);
  return result;
}

int unlink(const char* path) noexcept {
  return IsReadOnly() ? Fail(EROFS) : static_cast<int>(::syscall(SYS_unlink, path));
}

// The mode is garbage, and unused, where nothing is created.
int open(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const auto mode = va_arg(arguments, mode_t);
  va_end(arguments);
  return Open(AT_FDCWD, path, flags, mode);
}

int open64(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const auto mode = va_arg(arguments, mode_t);
  va_end(arguments);
  return Open(AT_FDCWD, path, flags, mode);
}

}  // extern "C"
