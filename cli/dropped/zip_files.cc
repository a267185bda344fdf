// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/dropped/zip_files.h"

#include <archive.h>
#include <archive_entry.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <memory>
#include <string_view>
#include <system_error>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/memory_room.h"
#include "common/base/printable.h"
#include "common/base/status.h"
#include "common/content/file_descriptor.h"
#include "common/content/relative_name.h"

namespace sheaf::cli {
namespace {

constexpr size_t kPieceBytes = size_t{256} << 10;

struct ArchiveEnd {
  void operator()(archive* zip) const { archive_read_free(zip); }
};
using Archive = std::unique_ptr<archive, ArchiveEnd>;

absl::Status DamagedError(archive* zip) {
  const char* const why = archive_error_string(zip);
  return absl::InvalidArgumentError(
      absl::StrCat("the zip file cannot be unpacked: ", Printable(why == nullptr ? "" : why)));
}

// The name in the zip file; empty if it has no readable name.
std::string NameOf(archive_entry* entry) {
  const char* name = archive_entry_pathname_utf8(entry);
  if (name == nullptr) name = archive_entry_pathname(entry);
  return name == nullptr ? "" : name;
}

bool IsNoteOfMacOs(std::string_view name) {
  return name.starts_with("__MACOSX/") || name == ".DS_Store" || name.ends_with("/.DS_Store");
}

// Counts the unpacked bytes and files.
class Budget {
 public:
  Budget(const ZipLimits& limits, uint64_t zip_bytes)
      : limits_(limits),
        bytes_max_(std::min(limits.bytes_max, kZipFreeBytes + kZipRatioMax * zip_bytes)) {}
  absl::Status AddFile() {
    if (++files_ <= limits_.files_max) return absl::OkStatus();
    return absl::ResourceExhaustedError(absl::StrCat(
        "the zip file has more than ", limits_.files_max, " files; use sheaf submit instead"));
  }
  absl::Status AddBytes(uint64_t bytes) {
    bytes_ += bytes;
    if (bytes_ <= bytes_max_) return absl::OkStatus();
    if (bytes_max_ < limits_.bytes_max) {
      return absl::ResourceExhaustedError(
          absl::StrCat("the zip file unpacks to more than ", kZipRatioMax,
                       " times its size, as zip bombs do; drop the folder instead"));
    }
    return absl::ResourceExhaustedError(absl::StrCat("the zip file unpacks to more than ",
                                                     FormatMemory(limits_.bytes_max),
                                                     "; use sheaf submit instead"));
  }

 private:
  const ZipLimits limits_;
  const uint64_t bytes_max_;
  uint64_t bytes_ = 0;
  uint32_t files_ = 0;
};

absl::Status WriteAll(int file, const char* bytes, size_t size, const std::string& name) {
  while (size > 0) {
    const ssize_t written = ::write(file, bytes, size);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return StatusFromErrno(errno, absl::StrCat("unpacking ", name));
    bytes += written;
    size -= static_cast<size_t>(written);
  }
  return absl::OkStatus();
}

absl::Status UnpackFile(archive* zip, const std::string& name, const std::string& path,
                        Budget* budget) {
  std::error_code error;
  std::filesystem::create_directories(std::filesystem::path(path).parent_path(), error);
  if (error) return StatusFromErrno(error.value(), absl::StrCat("making a folder for ", name));
  const FileDescriptor file(
      ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600));
  if (!file.ok() && errno == EEXIST) {
    return absl::InvalidArgumentError(absl::StrCat("the zip file has \"", name, "\" twice"));
  }
  if (!file.ok()) return StatusFromErrno(errno, absl::StrCat("unpacking ", name));
  std::vector<char> piece(kPieceBytes);
  while (true) {
    const la_ssize_t size = archive_read_data(zip, piece.data(), piece.size());
    if (size == 0) return absl::OkStatus();
    if (size < 0) return Annotate(DamagedError(zip), name);
    absl::Status status = budget->AddBytes(static_cast<uint64_t>(size));
    if (status.ok()) {
      status = WriteAll(file.get(), piece.data(), static_cast<size_t>(size), name);
    }
    if (!status.ok()) return status;
  }
}

absl::Status UnpackEntry(archive* zip, archive_entry* entry, const std::string& folder,
                         Budget* budget) {
  const std::string name = NameOf(entry);
  if (archive_entry_filetype(entry) == AE_IFDIR || IsNoteOfMacOs(name)) return absl::OkStatus();
  if (absl::Status status = CheckRelativeName(name); !status.ok()) return status;
  if (archive_entry_filetype(entry) != AE_IFREG || archive_entry_hardlink(entry) != nullptr) {
    return absl::InvalidArgumentError(
        absl::StrCat("\"", name, "\" in the zip file is a link or a device; only files are taken"));
  }
  if (absl::Status status = budget->AddFile(); !status.ok()) return status;
  return UnpackFile(zip, name, absl::StrCat(folder, "/", name), budget);
}

}  // namespace

absl::Status UnpackZip(const std::string& path, const std::string& folder,
                       const ZipLimits& limits) {
  std::error_code error;
  const uint64_t zip_bytes = std::filesystem::file_size(path, error);
  if (error) return StatusFromErrno(error.value(), path);
  const Archive zip(archive_read_new());
  if (zip == nullptr) return absl::ResourceExhaustedError("no memory to unpack the zip file");
  if (archive_read_support_format_zip(zip.get()) != ARCHIVE_OK ||
      archive_read_open_filename(zip.get(), path.c_str(), kPieceBytes) != ARCHIVE_OK) {
    return DamagedError(zip.get());
  }
  Budget budget(limits, zip_bytes);
  archive_entry* entry = nullptr;
  while (true) {
    const int result = archive_read_next_header(zip.get(), &entry);
    if (result == ARCHIVE_EOF) return absl::OkStatus();
    if (result != ARCHIVE_OK && result != ARCHIVE_WARN) return DamagedError(zip.get());
    absl::Status status = UnpackEntry(zip.get(), entry, folder, &budget);
    if (!status.ok()) return status;
  }
}

}  // namespace sheaf::cli
