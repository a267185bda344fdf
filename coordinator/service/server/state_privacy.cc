// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/server/state_privacy.h"

#include <sys/stat.h>

#include <filesystem>
#include <string_view>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"

namespace sheaf::coordinator {
namespace {

namespace fs = std::filesystem;

constexpr mode_t kOthers = 077;
// A coordinator keeps it locked. It is closed last, so that it tells whether all others are closed.
constexpr char kLockFile[] = "/lock";
// Files of the state directory, also with a suffix, as farm.db-wal.
constexpr std::string_view kNames[] = {"access",    "audit.log", "content", "dropped", "farm.db",
                                       "lease.key", "outputs",   "parts",   "reserve", "rounds"};

bool IsOurs(const std::string& name) {
  for (const std::string_view known : kNames) {
    if (name.starts_with(known)) return true;
  }
  return false;
}

// False: it stays open to others. Other file types have no contents to read, and links are not
// followed.
bool Close(const std::string& path) {
  struct stat info {};
  if (::lstat(path.c_str(), &info) != 0) return true;
  if ((!S_ISREG(info.st_mode) && !S_ISDIR(info.st_mode)) || (info.st_mode & kOthers) == 0) {
    return true;
  }
  return ::chmod(path.c_str(), info.st_mode & 07777 & ~kOthers) == 0;
}

// Closes the named file or folder and its contents. False: some of it stays open.
bool CloseTree(const std::string& path, size_t* left) {
  bool closed = Close(path);
  std::error_code error;
  if (!fs::is_directory(fs::symlink_status(path, error))) return closed;
  for (fs::recursive_directory_iterator it(path, error), end; !error && it != end;
       it.increment(error)) {
    if (*left == 0) return false;
    --*left;
    closed = Close(it->path().string()) && closed;
  }
  return closed;
}

}  // namespace

void CloseStateDirectory(const std::string& directory, size_t entries_max) {
  struct stat info {};
  if (::stat(directory.c_str(), &info) != 0) return;  // Nothing is there yet.
  bool closed = (info.st_mode & kOthers) == 0 ||
                ::chmod(directory.c_str(), info.st_mode & 07777 & ~kOthers) == 0;
  const std::string lock = directory + kLockFile;
  if (::stat(lock.c_str(), &info) == 0 && (info.st_mode & kOthers) != 0) {
    bool all_closed = true;
    std::error_code error;
    for (fs::directory_iterator it(directory, error), end; !error && it != end;
         it.increment(error)) {
      if (!IsOurs(it->path().filename().string())) continue;
      all_closed = CloseTree(it->path().string(), &entries_max) && all_closed;
    }
    closed = all_closed && Close(lock) && closed;
  }
  if (closed) return;
  LogWarning(absl::StrCat(directory, ": other accounts may read parts of it; run \"chmod -R go= ",
                          directory, "\" as the account to which it belongs"));
}

}  // namespace sheaf::coordinator
