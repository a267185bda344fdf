// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Commits that a start of SQLite drops from its write-ahead log because bits of it changed on disk.
// Each frame of the log holds a checksum of all frames before it, and SQLite silently takes the
// first frame with a wrong checksum for the end of the log, because an interrupted write leaves
// such an end, too. But a commit is flushed before the next one is written: it was complete if a
// frame follows it whose checksum continues from it. Frames of failed transactions (lack of space,
// a disk that did not flush), partly overwritten by later ones, may also lie behind the end of a
// log; no frame continues from one of their commits.
// Source: "Database File Format", section 4, and "WAL-mode File Format", section 4, at sqlite.org.
#pragma once

#include <cstdint>
#include <string>

namespace sheaf::coordinator {

// Returns the number of commits from the first wrong frame on; the last of them may not have been
// acknowledged. 0 if the log is whole, absent or unreadable, or may have been interrupted there.
// May also count failed commits. Call it before the database is opened. log_path: the database's
// path followed by "-wal".
int64_t CountLostCommits(const std::string& log_path);

}  // namespace sheaf::coordinator
