// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <climits>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "common/base/status.h"
#include "common/base/text/utf8.h"
#include "common/base/write_all.h"

namespace sheaf {
namespace {

constexpr int kLinksMax = 40;         // The limit of Linux.
constexpr mode_t kPublicMode = 0666;  // Less the umask, as of other programs.
constexpr mode_t kSecretMode = 0600;
constexpr mode_t kSecretFolderMode = 0700;

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }

 private:
  int fd_;
};

absl::Status WriteNewFile(const std::string& path, std::string_view bytes, bool sync, mode_t mode) {
  Descriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, mode));
  if (file.get() < 0) return StatusFromErrno(errno, absl::StrCat("creating ", path));
  if (absl::Status status = WriteAll(file.get(), bytes, path); !status.ok()) return status;
  if (sync && ::fsync(file.get()) != 0) {
    return StatusFromErrno(errno, absl::StrCat("fsync of ", path));
  }
  return absl::OkStatus();
}

std::string TemporaryName(const std::string& path) {
  static std::atomic<uint64_t> counter{0};
  const std::string ending = absl::StrCat(".tmp-", ::getpid(), "-", counter.fetch_add(1));
  const std::filesystem::path whole(path);
  // The name of a file may be as long as the file system takes, and leave no room for more.
  const std::string name = Utf8Prefix(whole.filename().string(), NAME_MAX - ending.size());
  return absl::StrCat((whole.parent_path() / name).string(), ending);
}

// Writes a temporary file beside `file` and renames it.
absl::Status WriteAndRename(const std::string& file, std::string_view bytes, bool sync,
                            mode_t mode) {
  const std::string temporary = TemporaryName(file);
  if (absl::Status status = WriteNewFile(temporary, bytes, sync, mode); !status.ok()) {
    ::unlink(temporary.c_str());
    return status;
  }
  if (::rename(temporary.c_str(), file.c_str()) != 0) {
    const int error = errno;
    ::unlink(temporary.c_str());
    return StatusFromErrno(error, absl::StrCat("renaming to ", file));
  }
  return absl::OkStatus();
}

absl::Status ReplaceFile(const std::string& path, std::string_view bytes, mode_t mode) {
  const absl::StatusOr<std::string> file = FollowToFile(path);
  if (!file.ok()) return file.status();
  absl::Status renamed = WriteAndRename(*file, bytes, /*sync=*/true, mode);
  if (!renamed.ok()) return renamed;
  std::string directory = std::filesystem::path(*file).parent_path().string();
  if (directory.empty()) directory = ".";
  Descriptor handle(::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (handle.get() < 0 || ::fsync(handle.get()) != 0) {
    return StatusFromErrno(errno, absl::StrCat("fsync of directory ", directory));
  }
  return absl::OkStatus();
}

// Returns the error's number, 0 if there is none.
int MakeMissingFolders(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return 0;
  const std::string parent = std::filesystem::path(path).parent_path().string();
  if (!parent.empty() && parent != path) {
    if (const int error = MakeMissingFolders(parent); error != 0) return error;
  }
  if (::mkdir(path.c_str(), kSecretFolderMode) == 0) return 0;
  if (errno != EEXIST) return errno;
  return std::filesystem::is_directory(path, ignored) ? 0 : ENOTDIR;
}

}  // namespace

absl::Status WriteAll(int fd, std::string_view bytes, const std::string& path) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd, bytes.data(), bytes.size());
    if (n < 0) {
      if (errno == EINTR) continue;
      return StatusFromErrno(errno, absl::StrCat("writing ", path));
    }
    bytes.remove_prefix(static_cast<size_t>(n));
  }
  return absl::OkStatus();
}

absl::Status WriteFileOnce(const std::string& path, std::string_view bytes) {
  return WriteNewFile(path, bytes, /*sync=*/false, kSecretMode);
}

absl::StatusOr<std::string> FollowToFile(const std::string& path) {
  std::string at = path;
  for (int links = 0; links < kLinksMax; ++links) {
    struct stat info {};
    if (::lstat(at.c_str(), &info) != 0) {
      if (errno == ENOENT) return at;
      return StatusFromErrno(errno, at);
    }
    if (S_ISREG(info.st_mode)) return at;
    if (!S_ISLNK(info.st_mode)) {
      return absl::FailedPreconditionError(
          absl::StrCat(path, ": is ", S_ISDIR(info.st_mode) ? "a directory" : "a device or a pipe",
                       ", not a regular file; name another"));
    }
    std::error_code error;
    const std::filesystem::path target = std::filesystem::read_symlink(at, error);
    if (error) return StatusFromErrno(error.value(), at);
    at = (std::filesystem::path(at).parent_path() / target).string();
  }
  return absl::FailedPreconditionError(
      absl::StrCat(path, ": more than ", kLinksMax, " symbolic links in a row; name another"));
}

absl::Status CheckWritable(const std::string& path) {
  const absl::StatusOr<std::string> file = FollowToFile(path);
  if (!file.ok()) return file.status();
  const std::string temporary = TemporaryName(*file);
  const Descriptor probe(
      ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, kPublicMode));
  if (probe.get() < 0) {
    return StatusFromErrno(errno, absl::StrCat(path, ": its folder is not writable"));
  }
  ::unlink(temporary.c_str());
  return absl::OkStatus();
}

absl::Status WriteFileAtomically(const std::string& path, std::string_view bytes) {
  return ReplaceFile(path, bytes, kPublicMode);
}

absl::Status WriteFileUnsynced(const std::string& path, std::string_view bytes) {
  return WriteAndRename(path, bytes, /*sync=*/false, kSecretMode);
}

absl::Status WriteSecretAtomically(const std::string& path, std::string_view bytes) {
  return ReplaceFile(path, bytes, kSecretMode);
}

absl::StatusOr<std::string> ReadWholeFile(const std::string& path, uint64_t size_bytes_max) {
  Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (file.get() < 0) return StatusFromErrno(errno, path);
  struct stat info {};
  if (::fstat(file.get(), &info) != 0) return StatusFromErrno(errno, path);
  if (S_ISDIR(info.st_mode))
    return absl::InvalidArgumentError(path + ": is a directory, not a file");
  std::string bytes;
  const auto size = static_cast<uint64_t>(info.st_size);
  if (size <= size_bytes_max) bytes.reserve(size);
  char buffer[1 << 16];
  while (true) {
    const ssize_t n = ::read(file.get(), buffer, sizeof buffer);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return StatusFromErrno(errno, absl::StrCat("reading ", path));
    if (n == 0) return bytes;
    if (bytes.size() + static_cast<size_t>(n) > size_bytes_max) {
      return absl::ResourceExhaustedError(
          absl::StrCat(path, ": larger than the limit of ", size_bytes_max, " bytes"));
    }
    bytes.append(buffer, static_cast<size_t>(n));
  }
}

absl::Status MakeDirectories(const std::string& path) {
  const int error = MakeMissingFolders(path);
  if (error == 0) return absl::OkStatus();
  return StatusFromErrno(error, absl::StrCat("creating directory ", path));
}

absl::StatusOr<std::unique_ptr<FileSystemSync>> FileSystemSync::Open(const std::string& directory) {
  const int fd = ::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return StatusFromErrno(errno, directory);
  return std::unique_ptr<FileSystemSync>(new FileSystemSync(directory, fd));
}

FileSystemSync::~FileSystemSync() { ::close(fd_); }

absl::Status FileSystemSync::Sync() const {
  if (::syncfs(fd_) == 0) return absl::OkStatus();
  return StatusFromErrno(errno, absl::StrCat("syncfs of the file system of ", directory_));
}

absl::Status MakePrivateDirectory(const std::string& path) {
  if (absl::Status status = MakeDirectories(path); !status.ok()) return status;
  struct stat info {};
  if (::stat(path.c_str(), &info) == 0 && (info.st_mode & 0777) == kSecretFolderMode) {
    return absl::OkStatus();
  }
  if (::chmod(path.c_str(), kSecretFolderMode) != 0) {
    return StatusFromErrno(errno, absl::StrCat("closing ", path, " to others"));
  }
  return absl::OkStatus();
}

}  // namespace sheaf
