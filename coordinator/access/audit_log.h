// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// AuditLog: who did what, and what was refused, as lines of JSON in STATE_DIR/audit.log:
//
//     {"time":"2026-01-31T12:00:00.000Z","who":"user:anna","what":"CancelJob","target":"jobs/7",
//      "outcome":"ok"}
//
// Calls that change something are recorded, and all calls that are refused; reads and the calls of
// workers at work are not. Files are limited in size, and refused calls in number: somebody who
// knocks a million times cannot wash other lines away.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "common/base/mutex.h"

namespace sheaf::coordinator {

inline constexpr uint64_t kAuditFileBytesMax = 16 << 20;  // Then it becomes audit.log.1.
inline constexpr int kAuditFilesKept = 8;                 // audit.log.1 to .8; older ones go.
inline constexpr int kAuditRefusalsPerMinuteMax = 600;
inline constexpr size_t kAuditTextBytesMax = 500;  // Of each value in a line.

// Thread safety: all members may be called concurrently, also by several processes.
class AuditLog {
 public:
  explicit AuditLog(std::string path) : path_(std::move(path)) {}

  // A line whose outcome is "ok", or the code and message of the error.
  void Note(const std::string& who, const std::string& what, const std::string& target,
            const absl::Status& outcome);
  // The same for a call that was not let in. Beyond kAuditRefusalsPerMinuteMax they are counted,
  // and the next minute's first line says how many there were.
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
