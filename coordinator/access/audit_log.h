// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// AuditLog: actions of callers and refused calls, as lines of JSON in STATE_DIR/audit.log:
//
//     {"time":"2026-01-31T12:00:00.000Z","who":"user:anna","what":"CancelJob","target":"jobs/7",
//      "outcome":"ok"}
//
// Records calls that change something, and all refused calls, but not reads and the regular calls
// of workers. Files are limited in size and refused calls in number, so that a million refused
// calls cannot displace other lines.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "common/base/mutex.h"

namespace sheaf::coordinator {

inline constexpr uint64_t kAuditFileBytesMax = 16 << 20;  // Then it becomes audit.log.1.
inline constexpr int kAuditFilesKept = 8;  // audit.log.1 to .8; older ones are removed.
inline constexpr int kAuditRefusalsPerMinuteMax = 600;
inline constexpr size_t kAuditTextBytesMax = 500;  // Per value in a line.

// Thread safety: all members may be called concurrently, also by several processes.
class AuditLog {
 public:
  explicit AuditLog(std::string path) : path_(std::move(path)) {}

  // A line whose outcome is "ok", or the code and message of the error.
  void Note(const std::string& who, const std::string& what, const std::string& target,
            const absl::Status& outcome);
  // The same for a refused call. Beyond kAuditRefusalsPerMinuteMax they are only counted, and the
  // next minute's first line has their number.
  void NoteRefused(const std::string& who, const std::string& what, const absl::Status& why,
                   absl::Time now);

 private:
  void Append(const std::string& line);
  void Rotate();

  const std::string path_;
  Mutex mutex_;
  absl::Time minute_begin_ ABSL_GUARDED_BY(mutex_) = absl::InfinitePast();
  int refusals_ ABSL_GUARDED_BY(mutex_) = 0;
  bool failing_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace sheaf::coordinator
