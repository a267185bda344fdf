// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/sandbox/private_root.h"

#include <fcntl.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "common/base/status.h"
#include "common/content/file_descriptor.h"

namespace sheaf::worker {
namespace {

// The new root is first mounted here; any folder that surely exists would do.
constexpr char kFirstPlace[] = "/usr";
// Where the new root shows the old one until it is complete.
constexpr char kOldRoot[] = "/.old-root";

absl::Status Failed(const std::string& step) {
  return StatusFromErrno(errno, absl::StrCat("making its file system: ", step));
}

absl::Status MakeFolder(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) return StatusFromErrno(error.value(), absl::StrCat("creating ", path));
  return absl::OkStatus();
}

// Something to mount on.
absl::Status MakeMountPoint(const std::string& path, bool folder) {
  if (folder) return MakeFolder(path);
  const std::string parent = std::filesystem::path(path).parent_path().string();
  if (absl::Status status = MakeFolder(parent); !status.ok()) return status;
  const FileDescriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0444));
  return file.ok() ? absl::OkStatus() : Failed(absl::StrCat("creating ", path));
}

absl::Status Bind(const std::string& source, const std::string& target) {
  const std::string old = absl::StrCat(kOldRoot, source);
  struct stat found {};
  if (::stat(old.c_str(), &found) != 0) return Failed(absl::StrCat("finding ", source));
  if (absl::Status status = MakeMountPoint(target, S_ISDIR(found.st_mode)); !status.ok()) {
    return status;
  }
  if (::mount(old.c_str(), target.c_str(), nullptr, MS_BIND | MS_REC, nullptr) != 0) {
    return Failed(absl::StrCat("mounting ", source));
  }
  return absl::OkStatus();
}

// Mounts a path where it is. Links (/lib is one to usr/lib) are repeated; what a folder mounted
// before already shows needs nothing.
absl::Status Repeat(const std::string& path) {
  std::error_code error;
  if (std::filesystem::exists(path, error)) return absl::OkStatus();
  const std::filesystem::path link =
      std::filesystem::read_symlink(absl::StrCat(kOldRoot, path), error);
  if (error) return Bind(path, path);
  std::filesystem::create_symlink(link, path, error);
  if (error) return StatusFromErrno(error.value(), absl::StrCat("linking ", path));
  return absl::OkStatus();
}

// Exchanges the root for an empty file system, which shows the old root at kOldRoot.
absl::Status Pivot() {
  if (::mount("", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0) return Failed("detaching it");
  if (::mount("tmpfs", kFirstPlace, "tmpfs", MS_NOSUID | MS_NODEV, "mode=0755") != 0) {
    return Failed("mounting an empty one");
  }
  if (::chdir(kFirstPlace) != 0 || ::mkdir(kOldRoot + 1, 0755) != 0) return Failed("entering it");
  if (::syscall(SYS_pivot_root, ".", kOldRoot + 1) != 0 || ::chdir("/") != 0) {
    return Failed("exchanging the root");
  }
  return absl::OkStatus();
}

// Lets go of the old root and makes everything that is left read-only.
absl::Status Seal() {
  if (::umount2(kOldRoot, MNT_DETACH) != 0 || ::rmdir(kOldRoot) != 0) {
    return Failed("leaving the old root");
  }
  mount_attr read_only{};
  read_only.attr_set = MOUNT_ATTR_RDONLY | MOUNT_ATTR_NOSUID | MOUNT_ATTR_NODEV;
  if (::mount_setattr(AT_FDCWD, "/", AT_RECURSIVE, &read_only, sizeof read_only) != 0) {
    return Failed("making it read-only");
  }
  return absl::OkStatus();
}

// Lets a folder, which is a mount, be written again.
absl::Status Unseal(const std::string& folder) {
  mount_attr writable{};
  writable.attr_clr = MOUNT_ATTR_RDONLY;
  if (::mount_setattr(AT_FDCWD, folder.c_str(), 0, &writable, sizeof writable) != 0) {
    return Failed(absl::StrCat("making ", folder, " writable"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status EnterPrivateRoot(const std::vector<MountedFile>& files,
                              const std::vector<std::string>& paths, const std::string& writable) {
  absl::Status status = Pivot();
  for (size_t i = 0; status.ok() && i < paths.size(); ++i) status = Repeat(paths[i]);
  for (size_t i = 0; status.ok() && i < files.size(); ++i) {
    status = Bind(files[i].source, files[i].target);
  }
  if (status.ok() && !writable.empty()) status = Bind(writable, writable);
  if (status.ok()) status = Seal();
  if (status.ok() && !writable.empty()) status = Unseal(writable);
  return status;
}

}  // namespace sheaf::worker
