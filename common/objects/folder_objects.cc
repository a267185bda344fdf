// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/objects/folder_objects.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "common/base/status.h"

namespace sheaf {
namespace {

namespace fs = std::filesystem;

// Objects are read into memory at once.
constexpr uint64_t kFileBytesMax = uint64_t{1} << 34;

absl::Time TimeOf(fs::file_time_type time) {
  return absl::Now() + absl::FromChrono(time - fs::file_time_type::clock::now());
}

bool IsKeyCharacter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
         c == '-' || c == '_' || c == '/';
}

}  // namespace

absl::Status CheckObjectKey(const std::string& key) {
  const bool is_path = !key.empty() && key.front() != '/' && key.back() != '/' &&
                       key.find("//") == std::string::npos &&
                       ("/" + key + "/").find("/../") == std::string::npos &&
                       ("/" + key + "/").find("/./") == std::string::npos;
  if (is_path && std::all_of(key.begin(), key.end(), IsKeyCharacter)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "\"", key, "\" is not the name of an object: relative, of letters, digits and ._-/"));
}

absl::StatusOr<std::unique_ptr<FolderObjects>> FolderObjects::Open(const std::string& directory,
                                                                   bool is_durable) {
  if (absl::Status status = MakeDirectories(directory); !status.ok()) return status;
  std::unique_ptr<FileSystemSync> file_system;
  if (is_durable) {
    absl::StatusOr<std::unique_ptr<FileSystemSync>> opened = FileSystemSync::Open(directory);
    if (!opened.ok()) return opened.status();
    file_system = *std::move(opened);
  }
  return std::unique_ptr<FolderObjects>(new FolderObjects(directory, std::move(file_system)));
}

absl::Status FolderObjects::Put(const std::string& key, std::string_view bytes, PutMode mode) {
  if (absl::Status status = CheckObjectKey(key); !status.ok()) return status;
  const std::string path = PathOf(key);
  std::error_code ignored;
  if (mode == PutMode::kIfAbsent && fs::exists(path, ignored)) {
    return absl::AlreadyExistsError(path + ": exists already");
  }
  absl::Status made = MakeDirectories(fs::path(path).parent_path().string());
  return made.ok() ? WriteFileUnsynced(path, bytes) : made;
}

absl::Status FolderObjects::PutFile(const std::string& key, const std::string& path) {
  const absl::StatusOr<std::string> bytes = ReadWholeFile(path, kFileBytesMax);
  return bytes.ok() ? Put(key, *bytes, PutMode::kReplace) : bytes.status();
}

absl::Status FolderObjects::Sync() {
  return file_system_ == nullptr ? absl::OkStatus() : file_system_->Sync();
}

absl::StatusOr<std::string> FolderObjects::Get(const std::string& key, const FileDigest& digest) {
  const std::string path = PathOf(key);
  absl::StatusOr<std::string> bytes = ReadWholeFile(path, digest.size_bytes + 1);
  const bool is_longer = absl::IsResourceExhausted(bytes.status());
  if (!bytes.ok() && !is_longer) return bytes;
  if (is_longer || bytes->size() != digest.size_bytes || Sha256Hex(*bytes) != digest.sha256_hex) {
    return absl::DataLossError(path +
                               ": the bytes do not match the digest under which they were stored");
  }
  return bytes;
}

absl::StatusOr<std::string> FolderObjects::GetRange(const std::string& key, uint64_t offset_bytes,
                                                    uint64_t size_bytes_max) {
  const std::string path = PathOf(key);
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return StatusFromErrno(errno, path);
  std::string bytes(size_bytes_max, '\0');
  size_t filled = 0;
  absl::Status status;
  while (filled < bytes.size()) {
    const ssize_t n = ::pread(fd, bytes.data() + filled, bytes.size() - filled,
                              static_cast<off_t>(offset_bytes + filled));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) status = StatusFromErrno(errno, absl::StrCat("reading ", path));
    if (n <= 0) break;
    filled += static_cast<size_t>(n);
  }
  ::close(fd);
  if (!status.ok()) return status;
  bytes.resize(filled);
  return bytes;
}

absl::StatusOr<uint64_t> FolderObjects::Head(const std::string& key) {
  std::error_code error;
  const uintmax_t size = fs::file_size(PathOf(key), error);
  if (error) return StatusFromErrno(error.value(), PathOf(key));
  return size;
}

absl::Status FolderObjects::List(const std::string& folder,
                                 const std::function<void(const StoredObject&)>& visit) {
  std::error_code error;
  for (fs::recursive_directory_iterator it(PathOf(folder), error), end; !error && it != end;
       it.increment(error)) {
    std::error_code failed;
    if (!it->is_regular_file(failed)) continue;
    const uintmax_t size_bytes = it->file_size(failed);
    if (failed) continue;  // It went meanwhile.
    const fs::file_time_type time = it->last_write_time(failed);
    if (failed) continue;
    visit({it->path().string().substr(directory_.size() + 1), size_bytes, TimeOf(time)});
  }
  if (!error || error == std::errc::no_such_file_or_directory) return absl::OkStatus();
  return StatusFromErrno(error.value(), absl::StrCat("listing ", PathOf(folder)));
}

absl::StatusOr<std::vector<std::string>> FolderObjects::ListFolders(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator it(PathOf(folder), error), end; !error && it != end;
       it.increment(error)) {
    std::error_code ignored;
    if (it->is_directory(ignored)) names.push_back(it->path().filename().string());
  }
  if (!error || error == std::errc::no_such_file_or_directory) return names;
  return StatusFromErrno(error.value(), absl::StrCat("listing ", PathOf(folder)));
}

absl::Status FolderObjects::Remove(const std::string& key) {
  std::error_code error;
  fs::remove(PathOf(key), error);
  if (!error) return absl::OkStatus();
  return StatusFromErrno(error.value(), absl::StrCat("removing ", PathOf(key)));
}

absl::Status FolderObjects::RemoveFolder(const std::string& folder) {
  if (folder.empty() || folder.back() != '/') {
    return absl::InvalidArgumentError(absl::StrCat("\"", folder, "\" is not the name of a folder"));
  }
  fs::path path = PathOf(folder.substr(0, folder.size() - 1));
  std::error_code error;
  fs::remove_all(path, error);
  if (error) return StatusFromErrno(error.value(), absl::StrCat("removing ", path.string()));
  std::error_code not_empty;
  for (path = path.parent_path(); path != fs::path(directory_); path = path.parent_path()) {
    if (!fs::remove(path, not_empty)) break;
  }
  return absl::OkStatus();
}

std::optional<PutTicket> FolderObjects::TicketToPut(const std::string& /*key*/,
                                                    const FileDigest& /*digest*/) {
  return std::nullopt;
}

}  // namespace sheaf
