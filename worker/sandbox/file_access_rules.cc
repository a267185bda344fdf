// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/sandbox/file_access_rules.h"

#include <fcntl.h>
#include <linux/landlock.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>

#include "absl/strings/str_cat.h"
#include "common/base/status.h"
#include "common/content/file_descriptor.h"

namespace sheaf::worker {
namespace {

constexpr uint64_t kRead = LANDLOCK_ACCESS_FS_READ_FILE;
constexpr uint64_t kStart = kRead | LANDLOCK_ACCESS_FS_EXECUTE;
constexpr uint64_t kReadFolder = kRead | LANDLOCK_ACCESS_FS_READ_DIR;
constexpr uint64_t kWriteFolder = kReadFolder | LANDLOCK_ACCESS_FS_WRITE_FILE |
                                  LANDLOCK_ACCESS_FS_REMOVE_DIR | LANDLOCK_ACCESS_FS_REMOVE_FILE |
                                  LANDLOCK_ACCESS_FS_MAKE_DIR | LANDLOCK_ACCESS_FS_MAKE_REG;
// Everything that the first version of Landlock can forbid: all of its bits up to MAKE_SYM.
constexpr uint64_t kForbidden = (uint64_t{LANDLOCK_ACCESS_FS_MAKE_SYM} << 1) - 1;

// folder_access: if the path is a folder.
absl::Status Allow(int rules, const std::string& path, uint64_t folder_access,
                   uint64_t file_access = kRead) {
  const FileDescriptor file(::open(path.c_str(), O_PATH | O_CLOEXEC));
  struct stat found {};
  if (!file.ok() || ::fstat(file.get(), &found) != 0) {
    return StatusFromErrno(errno, absl::StrCat("opening ", path));
  }
  landlock_path_beneath_attr rule{};
  rule.allowed_access = S_ISDIR(found.st_mode) ? folder_access : file_access;
  rule.parent_fd = file.get();
  if (::syscall(SYS_landlock_add_rule, rules, LANDLOCK_RULE_PATH_BENEATH, &rule, 0) != 0) {
    return StatusFromErrno(errno, absl::StrCat("allowing to read ", path));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status AllowReadingOnly(const std::vector<std::string>& paths, const std::string& writable,
                              const std::vector<std::string>& programs) {
  landlock_ruleset_attr attributes{};
  attributes.handled_access_fs = kForbidden;
  const FileDescriptor rules(static_cast<int>(
      ::syscall(SYS_landlock_create_ruleset, &attributes, sizeof attributes.handled_access_fs, 0)));
  if (!rules.ok()) return StatusFromErrno(errno, "making Landlock's rules");
  for (const std::string& path : paths) {
    if (absl::Status status = Allow(rules.get(), path, kReadFolder); !status.ok()) return status;
  }
  if (!writable.empty()) {
    absl::Status status = Allow(rules.get(), writable, kWriteFolder);
    if (!status.ok()) return status;
  }
  for (const std::string& program : programs) {
    absl::Status status = Allow(rules.get(), program, kReadFolder, kStart);
    if (!status.ok()) return status;
  }
  if (::syscall(SYS_landlock_restrict_self, rules.get(), 0) != 0) {
    return StatusFromErrno(errno, "applying Landlock's rules");
  }
  return absl::OkStatus();
}

}  // namespace sheaf::worker
