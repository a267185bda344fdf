// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/access/audit_log.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/log.h"
#include "common/base/status.h"

namespace sheaf::coordinator {
namespace {

std::string Line(const std::string& who, const std::string& what, const std::string& target,
                 const std::string& outcome) {
  nlohmann::ordered_json json = {
      {"time", absl::FormatTime("%Y-%m-%dT%H:%M:%E3SZ", absl::Now(), absl::UTCTimeZone())},
      {"who", who.substr(0, kAuditTextBytesMax)},
      {"what", what.substr(0, kAuditTextBytesMax)},
      {"target", target.substr(0, kAuditTextBytesMax)},
      {"outcome", outcome.substr(0, kAuditTextBytesMax)}};
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

std::string OutcomeText(const absl::Status& status) {
  return status.ok() ? "ok"
                     : absl::StrCat(absl::StatusCodeToString(status.code()), ": ",
                                    std::string(status.message()));
}

// Appends in one write, so that lines of several processes do not mix. Returns the file's size.
absl::StatusOr<uint64_t> AppendTo(const std::string& path, const std::string& line) {
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
  if (fd < 0) return StatusFromErrno(errno, path);
  absl::Status status;
  struct stat info {};
  if (::write(fd, line.data(), line.size()) != static_cast<ssize_t>(line.size()) ||
      ::fstat(fd, &info) != 0) {
    status = StatusFromErrno(errno, path);
  }
  ::close(fd);
  if (!status.ok()) return status;
  return static_cast<uint64_t>(info.st_size);
}

}  // namespace

void AuditLog::Note(const std::string& who, const std::string& what, const std::string& target,
                    const absl::Status& outcome) {
  Append(Line(who, what, target, OutcomeText(outcome)));
}

void AuditLog::NoteRefused(const std::string& who, const std::string& what, const absl::Status& why,
                           absl::Time now) {
  int left_out = 0;
  {
    const MutexLock lock(&mutex_);
    if (now - minute_begin_ >= absl::Minutes(1)) {
      left_out = refusals_ - kAuditRefusalsPerMinuteMax;
      minute_begin_ = now;
      refusals_ = 0;
    }
    if (++refusals_ > kAuditRefusalsPerMinuteMax) return;
  }
  if (left_out > 0) {
    Append(Line("", "", "", absl::StrCat(left_out, " more calls were refused and are not listed")));
  }
  Append(Line(who, what, "", OutcomeText(why)));
}

void AuditLog::Append(const std::string& line) {
  const absl::StatusOr<uint64_t> size = AppendTo(path_, line);
  const MutexLock lock(&mutex_);
  if (!size.ok() && !failing_) {
    LogError(absl::StrCat("the audit log cannot be written: ", size.status().message()));
  }
  failing_ = !size.ok();
  if (size.ok() && *size > kAuditFileBytesMax) Rotate();
}

void AuditLog::Rotate() {
  const int fd = ::open(path_.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat info {};
  // Another process may have rotated meanwhile; it holds the lock while it rotates.
  const bool mine = fd >= 0 && ::flock(fd, LOCK_EX | LOCK_NB) == 0 &&
                    ::stat(path_.c_str(), &info) == 0 &&
                    static_cast<uint64_t>(info.st_size) > kAuditFileBytesMax;
  if (mine) {
    for (int i = kAuditFilesKept - 1; i >= 1; --i) {
      std::rename(absl::StrCat(path_, ".", i).c_str(), absl::StrCat(path_, ".", i + 1).c_str());
    }
    std::rename(path_.c_str(), absl::StrCat(path_, ".1").c_str());
  }
  if (fd >= 0) ::close(fd);
}

}  // namespace sheaf::coordinator
