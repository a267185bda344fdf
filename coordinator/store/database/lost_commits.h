// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Commits that a start of SQLite drops from its write-ahead log because bits of it changed on disk.
// Each frame of the log holds a checksum of all before it, and SQLite takes the first frame whose
// checksum is wrong for the end of the log, without a word: such an end is also what a write leaves
// that was interrupted. But a commit is flushed before the next one is written, so that a wrong
// frame which a commit and one more frame of the same log follow was whole once.
// Source: "Database File Format", section 4, and "WAL-mode File Format", section 4, at sqlite.org.
#pragma once

#include <cstdint>
#include <string>

namespace sheaf::coordinator {

// The number of commits from the first wrong frame on; the last of them may not have been
// acknowledged. 0 where the log is whole, absent or unreadable, or may have been interrupted there.
// A commit that failed for lack of space can count, too. Call it before the database is opened.
// log_path: that of the database, followed by "-wal".
int64_t CountLostCommits(const std::string& log_path);

}  // namespace sheaf::coordinator
