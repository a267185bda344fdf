// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/dropped/dropped_files.h"

#include <fcntl.h>
#include <linux/openat2.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/base/file.h"
#include "common/base/memory_room.h"
#include "common/base/printable.h"
#include "common/base/status.h"
#include "common/content/relative_name.h"

namespace sheaf::coordinator {
namespace {

constexpr char kFilesFolder[] = "/files";
constexpr char kScratchFolder[] = "/scratch";
constexpr int kFolderFlags = O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC;

// Opens the folder of a name; creates it if necessary. *leaf: the last part of the name.
absl::StatusOr<FileDescriptor> FolderOfName(int files, const std::string& name, std::string* leaf) {
  std::vector<std::string> parts = absl::StrSplit(name, '/');
  *leaf = parts.back();
  parts.pop_back();
  FileDescriptor folder(::openat(files, ".", kFolderFlags));
  for (const std::string& part : parts) {
    if (!folder.ok()) break;
    if (::mkdirat(folder.get(), part.c_str(), 0700) != 0 && errno != EEXIST) {
      return StatusFromErrno(errno, absl::StrCat("making the folder of ", name));
    }
    folder = FileDescriptor(::openat(folder.get(), part.c_str(), kFolderFlags));
  }
  if (folder.ok()) return folder;
  if (errno == ENOTDIR || errno == ELOOP) {
    return absl::InvalidArgumentError(
        absl::StrCat("\"", name, "\" lies in a folder that was sent as a file"));
  }
  return StatusFromErrno(errno, absl::StrCat("opening the folder of ", name));
}

}  // namespace

absl::StatusOr<std::unique_ptr<DroppedFiles>> DroppedFiles::Create(
    const std::string& folder, const DroppedLimits& limits, WriteWithSpace write_with_space) {
  if (::mkdir(folder.c_str(), 0700) != 0) {
    return StatusFromErrno(errno, absl::StrCat("making ", folder));
  }
  for (const char* below : {kFilesFolder, kScratchFolder}) {
    if (absl::Status status = MakePrivateDirectory(folder + below); !status.ok()) return status;
  }
  FileDescriptor files(::open((folder + kFilesFolder).c_str(), kFolderFlags));
  if (!files.ok()) return StatusFromErrno(errno, absl::StrCat("opening ", folder));
  return std::unique_ptr<DroppedFiles>(
      new DroppedFiles(folder, std::move(files), limits, std::move(write_with_space)));
}

DroppedFiles::~DroppedFiles() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

absl::Status DroppedFiles::CheckLimits(const std::string& name, uint64_t more) const {
  if (!sizes_.contains(name) && sizes_.size() >= limits_.files_max) {
    return absl::ResourceExhaustedError(
        absl::StrCat("more than ", limits_.files_max,
                     " files were dropped, the limit of this coordinator; use sheaf submit"));
  }
  if (more > limits_.bytes_max - bytes_) {
    return absl::ResourceExhaustedError(
        absl::StrCat("the dropped files are larger than ", FormatMemory(limits_.bytes_max),
                     ", the limit of this coordinator (--drop-bytes-max); use sheaf submit"));
  }
  return absl::OkStatus();
}

absl::Status DroppedFiles::Write(const std::string& name, std::string_view bytes,
                                 bool is_new) const {
  std::string leaf;
  const absl::StatusOr<FileDescriptor> folder = FolderOfName(files_.get(), name, &leaf);
  if (!folder.ok()) return folder.status();
  const int how = is_new ? O_CREAT | O_EXCL : 0;
  const FileDescriptor file(::openat(folder->get(), leaf.c_str(),
                                     O_WRONLY | O_APPEND | O_NOFOLLOW | O_CLOEXEC | how, 0600));
  if (!file.ok() && (errno == EISDIR || errno == EEXIST)) {
    return absl::InvalidArgumentError(
        absl::StrCat("\"", name, "\" was sent as a folder and as a file"));
  }
  if (!file.ok()) return StatusFromErrno(errno, absl::StrCat("storing ", name));
  struct stat before {};
  if (::fstat(file.get(), &before) != 0) return StatusFromErrno(errno, name);
  while (!bytes.empty()) {
    const ssize_t written = ::write(file.get(), bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written > 0) {
      bytes.remove_prefix(static_cast<size_t>(written));
      continue;
    }
    const int error = errno;
    // So that the piece can be sent again.
    if (::ftruncate(file.get(), before.st_size) != 0) return StatusFromErrno(errno, name);
    return StatusFromErrno(error, absl::StrCat("storing ", name));
  }
  return absl::OkStatus();
}

absl::StatusOr<uint64_t> DroppedFiles::Append(const std::string& name, uint64_t offset_bytes,
                                              std::string_view bytes) {
  if (absl::Status status = CheckRelativeName(name); !status.ok()) return status;
  const auto known = sizes_.find(name);
  const bool is_new = known == sizes_.end();
  const uint64_t size = is_new ? 0 : known->second;
  if (offset_bytes > size) {
    return absl::OutOfRangeError(
        absl::StrCat(name, ": byte ", offset_bytes, " comes after ", size, "; continue there"));
  }
  // The answer to an earlier call may have been lost.
  const uint64_t there = size - offset_bytes;
  if (!is_new && there >= bytes.size()) return size;
  bytes.remove_prefix(there);
  if (absl::Status status = CheckLimits(name, bytes.size()); !status.ok()) return status;
  absl::Status status = write_with_space_(bytes.size(), [&] { return Write(name, bytes, is_new); });
  if (!status.ok()) return status;
  bytes_ += bytes.size();
  return sizes_[name] = size + bytes.size();
}

absl::Status DroppedFiles::ClearScratch() {
  const std::string scratch = folder_ + kScratchFolder;
  std::error_code error;
  std::filesystem::remove_all(scratch, error);
  if (error) return StatusFromErrno(error.value(), absl::StrCat("clearing ", scratch));
  return MakePrivateDirectory(scratch);
}

absl::StatusOr<FileDescriptor> OpenBeneath(const std::string& folder, const std::string& name) {
  const FileDescriptor root(::open(folder.c_str(), kFolderFlags));
  if (!root.ok()) return StatusFromErrno(errno, absl::StrCat("opening ", folder));
  open_how how{};
  how.flags = O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC;
  how.resolve = RESOLVE_BENEATH | RESOLVE_NO_SYMLINKS | RESOLVE_NO_MAGICLINKS;
  FileDescriptor file(
      static_cast<int>(::syscall(SYS_openat2, root.get(), name.c_str(), &how, sizeof how)));
  if (!file.ok() && (errno == EXDEV || errno == ELOOP)) {
    return absl::InvalidArgumentError(absl::StrCat("the scene names ", Printable(name),
                                                   ", which is not among the dropped files"));
  }
  if (!file.ok()) return StatusFromErrno(errno, absl::StrCat("opening ", Printable(name)));
  struct stat info {};
  if (::fstat(file.get(), &info) != 0 || !S_ISREG(info.st_mode)) {
    return absl::InvalidArgumentError(absl::StrCat(Printable(name), " is not a file"));
  }
  return file;
}

}  // namespace sheaf::coordinator
