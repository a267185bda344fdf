// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The functions of the C library that read clocks and work on files, as this program defines them:
// for paths and descriptors of the simulated machine they are its own, for all others the system's.
// A program's definitions come before the C library's, also for the libraries that it uses.
#include <dirent.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdarg>
#include <ctime>
#include <memory>

#include "absl/time/time.h"
#include "tests/sim/machine.h"
#include "tests/sim/sim_files.h"

namespace {

using namespace sheaf::sim;  // Its functions stand beside those of the C library.

// The C library's own function.
template <typename Function>
Function* Next(const char* name) {
  return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

// 0 where the flags say that open has no such argument.
mode_t ModeOf(int flags, va_list arguments) {
  return (flags & O_CREAT) != 0 ? va_arg(arguments, mode_t) : 0;
}

}  // namespace

extern "C" {

// OpenSSL's, which takes its bytes from the system in more ways than are worth to stand in for.
int RAND_bytes(unsigned char* buffer, int count) {
  Machine* machine = Machine::Current();
  if (machine == nullptr) return 0;
  std::generate_n(buffer, count, [machine] {
    return static_cast<unsigned char>(machine->random_bytes().Below(256));
  });
  return 1;
}

int clock_gettime(clockid_t clock, timespec* time) noexcept {
  const Machine* machine = Machine::Current();
  if (machine == nullptr) return static_cast<int>(::syscall(SYS_clock_gettime, clock, time));
  switch (clock) {
    case CLOCK_REALTIME:
    case CLOCK_REALTIME_COARSE:
      *time = absl::ToTimespec(machine->wall());
      return 0;
    case CLOCK_THREAD_CPUTIME_ID:
    case CLOCK_PROCESS_CPUTIME_ID:
      *time = {};  // Work takes no time.
      return 0;
    default:
      *time = absl::ToTimespec(machine->steady());
      return 0;
  }
}

int gettimeofday(timeval* time, void* /*zone*/) noexcept {
  timespec now{};
  if (clock_gettime(CLOCK_REALTIME, &now) != 0) return -1;
  *time = {now.tv_sec, now.tv_nsec / 1000};
  return 0;
}

int open(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = ModeOf(flags, arguments);
  va_end(arguments);
  if (IsOurs(path)) return OpenOurs(path, flags);
  const bool is_random = Machine::Current() != nullptr && std::strcmp(path, "/dev/urandom") == 0;
  if (is_random) return OpenOurs(sheaf::sim::kSimRandomDevice, O_RDONLY);
  return static_cast<int>(::syscall(SYS_openat, AT_FDCWD, path, flags, mode));
}

int open64(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = ModeOf(flags, arguments);
  va_end(arguments);
  return open(path, flags, mode);
}

int openat(int folder, const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = ModeOf(flags, arguments);
  va_end(arguments);
  if (IsOursAt(folder, path)) return OpenOurs(PathAt(folder, path), flags);
  return static_cast<int>(::syscall(SYS_openat, folder, path, flags, mode));
}

int close(int descriptor) {
  if (!IsOurs(descriptor)) return static_cast<int>(::syscall(SYS_close, descriptor));
  if (Machine* machine = Machine::Current()) machine->RemoveDescriptor(descriptor);
  return 0;
}

ssize_t read(int descriptor, void* buffer, size_t count) {
  if (!IsOurs(descriptor)) return ::syscall(SYS_read, descriptor, buffer, count);
  Machine::OpenFile* file = Opened(descriptor);
  if (file == nullptr) return Done(EBADF);
  const ssize_t n = ReadOurs(descriptor, buffer, count, file->offset);
  if (n > 0) file->offset += static_cast<uint64_t>(n);
  return n;
}

ssize_t write(int descriptor, const void* bytes, size_t count) {
  if (!IsOurs(descriptor)) return ::syscall(SYS_write, descriptor, bytes, count);
  Machine::OpenFile* file = Opened(descriptor);
  if (file == nullptr) return Done(EBADF);
  if (file->appends) file->offset = file->node->bytes.size();
  const ssize_t n = WriteOurs(descriptor, bytes, count, file->offset);
  if (n > 0) file->offset += static_cast<uint64_t>(n);
  return n;
}

ssize_t pread64(int descriptor, void* buffer, size_t count, off64_t offset) {
  if (!IsOurs(descriptor)) return ::syscall(SYS_pread64, descriptor, buffer, count, offset);
  return ReadOurs(descriptor, buffer, count, static_cast<uint64_t>(offset));
}
ssize_t pread(int descriptor, void* buffer, size_t count, off_t offset) {
  return pread64(descriptor, buffer, count, offset);
}

ssize_t pwrite64(int descriptor, const void* bytes, size_t count, off64_t offset) {
  if (!IsOurs(descriptor)) return ::syscall(SYS_pwrite64, descriptor, bytes, count, offset);
  return WriteOurs(descriptor, bytes, count, static_cast<uint64_t>(offset));
}
ssize_t pwrite(int descriptor, const void* bytes, size_t count, off_t offset) {
  return pwrite64(descriptor, bytes, count, offset);
}

off64_t lseek64(int descriptor, off64_t offset, int whence) noexcept {
  if (!IsOurs(descriptor)) return ::syscall(SYS_lseek, descriptor, offset, whence);
  Machine::OpenFile* file = Opened(descriptor);
  if (file == nullptr) return Done(EBADF);
  const auto size = static_cast<off64_t>(file->node->bytes.size());
  const auto at = static_cast<off64_t>(file->offset);
  const off64_t base = whence == SEEK_SET ? 0 : whence == SEEK_CUR ? at : size;
  file->offset = static_cast<uint64_t>(base + offset);
  return base + offset;
}
off_t lseek(int descriptor, off_t offset, int whence) noexcept {
  return lseek64(descriptor, offset, whence);
}

int fsync(int descriptor) {
  if (!IsOurs(descriptor)) return static_cast<int>(::syscall(SYS_fsync, descriptor));
  return SyncOurs(descriptor);
}
int syncfs(int descriptor) noexcept {
  if (!IsOurs(descriptor)) return static_cast<int>(::syscall(SYS_syncfs, descriptor));
  return Done(Opened(descriptor) == nullptr ? EBADF : Machine::Current()->disk().SyncAll());
}
int fdatasync(int descriptor) { return fsync(descriptor); }

int ftruncate64(int descriptor, off64_t size) noexcept {
  if (!IsOurs(descriptor)) return static_cast<int>(::syscall(SYS_ftruncate, descriptor, size));
  return TruncateOurs(descriptor, size);
}
int ftruncate(int descriptor, off_t size) noexcept { return ftruncate64(descriptor, size); }

int stat(const char* path, struct stat* info) noexcept {
  if (IsOurs(path)) return StatOurs(path, info);
  return static_cast<int>(::syscall(SYS_newfstatat, AT_FDCWD, path, info, 0));
}
int stat64(const char* path, struct stat64* info) noexcept {
  if (IsOurs(path)) return StatOurs(path, info);
  return static_cast<int>(::syscall(SYS_newfstatat, AT_FDCWD, path, info, 0));
}
int lstat(const char* path, struct stat* info) noexcept {
  if (IsOurs(path)) return StatOurs(path, info);
  return static_cast<int>(::syscall(SYS_newfstatat, AT_FDCWD, path, info, AT_SYMLINK_NOFOLLOW));
}
int lstat64(const char* path, struct stat64* info) noexcept {
  if (IsOurs(path)) return StatOurs(path, info);
  return static_cast<int>(::syscall(SYS_newfstatat, AT_FDCWD, path, info, AT_SYMLINK_NOFOLLOW));
}
int fstat(int descriptor, struct stat* info) noexcept {
  if (IsOurs(descriptor)) return StatOpened(descriptor, info);
  return static_cast<int>(::syscall(SYS_fstat, descriptor, info));
}
int fstat64(int descriptor, struct stat64* info) noexcept {
  if (IsOurs(descriptor)) return StatOpened(descriptor, info);
  return static_cast<int>(::syscall(SYS_fstat, descriptor, info));
}

int access(const char* path, int mode) noexcept {
  if (!IsOurs(path)) return static_cast<int>(::syscall(SYS_faccessat, AT_FDCWD, path, mode));
  SimDisk::NodePtr node;
  return Done(Machine::Current()->disk().Find(path, &node));
}

ssize_t readlink(const char* path, char* buffer, size_t size) noexcept {
  if (!IsOurs(path)) return ::syscall(SYS_readlinkat, AT_FDCWD, path, buffer, size);
  return Done(EINVAL);  // There are no links.
}

int mkdir(const char* path, mode_t mode) noexcept {
  if (!IsOurs(path)) return static_cast<int>(::syscall(SYS_mkdirat, AT_FDCWD, path, mode));
  return Done(Machine::Current()->disk().MakeFolder(path));
}
int rmdir(const char* path) noexcept {
  if (!IsOurs(path)) {
    return static_cast<int>(::syscall(SYS_unlinkat, AT_FDCWD, path, AT_REMOVEDIR));
  }
  return RemoveOurs(path, /*folder=*/true);
}
int unlink(const char* path) noexcept {
  if (!IsOurs(path)) return static_cast<int>(::syscall(SYS_unlinkat, AT_FDCWD, path, 0));
  return RemoveOurs(path, /*folder=*/false);
}
int unlinkat(int folder, const char* path, int flags) noexcept {
  if (!IsOursAt(folder, path)) {
    return static_cast<int>(::syscall(SYS_unlinkat, folder, path, flags));
  }
  return RemoveOurs(PathAt(folder, path), (flags & AT_REMOVEDIR) != 0);
}
int remove(const char* path) noexcept {
  if (unlink(path) == 0) return 0;
  return errno == EISDIR ? rmdir(path) : -1;
}
int rename(const char* from, const char* to) noexcept {
  if (!IsOurs(from)) {
    return static_cast<int>(::syscall(SYS_renameat, AT_FDCWD, from, AT_FDCWD, to));
  }
  return Done(Machine::Current()->disk().Rename(from, to));
}

int fchmod(int descriptor, mode_t mode) noexcept {
  return IsOurs(descriptor) ? 0 : static_cast<int>(::syscall(SYS_fchmod, descriptor, mode));
}
int fchown(int descriptor, uid_t user, gid_t group) noexcept {
  return IsOurs(descriptor) ? 0 : static_cast<int>(::syscall(SYS_fchown, descriptor, user, group));
}

// Locks: there is one process.
int flock(int descriptor, int operation) noexcept {
  return IsOurs(descriptor) ? 0 : static_cast<int>(::syscall(SYS_flock, descriptor, operation));
}
int fcntl64(int descriptor, int command, ...) {
  va_list arguments;
  va_start(arguments, command);
  void* argument = va_arg(arguments, void*);
  va_end(arguments);
  if (!IsOurs(descriptor)) {
    return static_cast<int>(::syscall(SYS_fcntl, descriptor, command, argument));
  }
  if (command == F_GETLK) static_cast<struct flock*>(argument)->l_type = F_UNLCK;
  return 0;
}
int fcntl(int descriptor, int command, ...) {
  va_list arguments;
  va_start(arguments, command);
  void* argument = va_arg(arguments, void*);
  va_end(arguments);
  return fcntl64(descriptor, command, argument);
}

void* mmap64(void* address, size_t size, int protection, int flags, int descriptor,
             off64_t offset) noexcept {
  Machine::OpenFile* file = IsOurs(descriptor) ? Opened(descriptor) : nullptr;
  if (file != nullptr) {
    return Machine::Current()->Map(file->node, static_cast<uint64_t>(offset), size);
  }
  return reinterpret_cast<void*>(
      ::syscall(SYS_mmap, address, size, protection, flags, descriptor, offset));
}
void* mmap(void* address, size_t size, int protection, int flags, int descriptor,
           off_t offset) noexcept {
  return mmap64(address, size, protection, flags, descriptor, offset);
}
int munmap(void* address, size_t size) noexcept {
  Machine* machine = Machine::Current();
  if (machine != nullptr && machine->Unmap(address)) return 0;
  return static_cast<int>(::syscall(SYS_munmap, address, size));
}

DIR* fdopendir(int descriptor) {
  return IsOurs(descriptor) ? ListOurs(descriptor) : Next<DIR*(int)>("fdopendir")(descriptor);
}
DIR* opendir(const char* path) {
  if (!IsOurs(path)) return Next<DIR*(const char*)>("opendir")(path);
  const int descriptor = OpenOurs(path, O_RDONLY | O_DIRECTORY);
  return descriptor < 0 ? nullptr : ListOurs(descriptor);
}
dirent* readdir(DIR* folder) {
  if (!IsOurs(folder)) return Next<dirent*(DIR*)>("readdir")(folder);
  auto* listing = reinterpret_cast<Listing*>(folder);
  return listing->next < listing->entries.size() ? &listing->entries[listing->next++] : nullptr;
}
int dirfd(DIR* folder) noexcept {
  if (!IsOurs(folder)) return Next<int(DIR*)>("dirfd")(folder);
  return reinterpret_cast<Listing*>(folder)->descriptor;
}
int closedir(DIR* folder) {
  if (!IsOurs(folder)) return Next<int(DIR*)>("closedir")(folder);
  const std::unique_ptr<Listing> listing(reinterpret_cast<Listing*>(folder));
  Listings().erase(listing.get());
  return close(listing->descriptor);
}

}  // extern "C"
