// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Commits that a start of SQLite drops from its write-ahead log because bits of it changed on disk.
// Each frame of the log holds a checksum of all before it, and SQLite takes the first frame whose
// checksum is wrong for the end of the log, without a word: such an end is also what a write leaves
// that was interrupted. But a commit is flushed before the next one is written: it was whole once
// if a frame follows it whose checksum goes on from it. Behind the end of a log may also lie frames
// of transactions that failed, for lack of space or by a disk that did not flush, and that later
// ones overwrote in part; none of their commits is followed so.
// Source: "Database File Format", section 4, and "WAL-mode File Format", section 4, at sqlite.org.
#pragma once

#include <cstdint>
#include <string>

namespace sheaf::coordinator {

// The number of commits from the first wrong frame on; the last of them may not have been
// acknowledged. 0 where the log is whole, absent or unreadable, or may have been interrupted there.
// Commits that failed may count beside those. Call it before the database is opened.
// log_path: that of the database, followed by "-wal".
int64_t CountLostCommits(const std::string& log_path);

}  // namespace sheaf::coordinator
