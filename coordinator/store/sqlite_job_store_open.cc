// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of SqliteJobStore that opens it: lock, integrity check, schema; and that tests whether
// the disk accepts writes.
#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "common/base/file.h"
#include "common/base/log.h"
#include "common/base/status.h"
#include "common/objects/folder_objects.h"
#include "coordinator/store/sqlite_job_store.h"
#include "coordinator/store/sqlite_schema.h"

namespace sheaf::coordinator {
namespace {

// Lease ids of one run are below those of the next; no run grants more leases than this many bits
// count.
constexpr int kLeaseIdBitsPerLife = 40;
// Time limit for checking the database at a start; it suffices for hundreds of megabytes.
constexpr absl::Duration kCheckTimeMax = absl::Seconds(2);

// Takes the lock that excludes a second coordinator. The system releases it when the process ends.
absl::StatusOr<int> LockDirectory(const std::string& directory) {
  const std::string path = directory + "/lock";
  const int fd = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (fd < 0) return StatusFromErrno(errno, path);
  if (::flock(fd, LOCK_EX | LOCK_NB) == 0) return fd;
  const int error = errno;
  ::close(fd);
  if (error != EWOULDBLOCK) return StatusFromErrno(error, path);
  return absl::FailedPreconditionError(
      directory + ": another coordinator uses this state directory; stop it or choose another one");
}

// The size of a test write: more than a row, less than most parts.
constexpr size_t kProbeBytes = size_t{1} << 20;
constexpr char kProbeName[] = "probe";

}  // namespace

absl::StatusOr<std::unique_ptr<SqliteJobStore>> SqliteJobStore::Open(const std::string& directory,
                                                                     Durability durability,
                                                                     ObjectStore* parts) {
  for (const std::string sub : {"", "/parts", "/outputs"}) {
    if (absl::Status status = MakeDirectories(directory + sub); !status.ok()) return status;
  }
  const absl::StatusOr<int> lock = LockDirectory(directory);
  if (!lock.ok()) return lock.status();
  std::unique_ptr<SqliteJobStore> store(new SqliteJobStore(directory, durability, *lock, parts));
  if (absl::Status status = store->Initialize(); !status.ok()) return store->Explained(status);
  return store;
}

SqliteJobStore::~SqliteJobStore() {
  {
    const MutexLock lock(&database_mutex_);
    database_.reset();
  }
  ::close(lock_fd_);
}

absl::Status SqliteJobStore::Explained(const absl::Status& status) const {
  if (!absl::IsDataLoss(status)) return status;
  const std::string path = DatabasePath();
  absl::string_view what = status.message();
  absl::ConsumePrefix(&what, path + ": ");
  return absl::DataLossError(absl::StrCat(
      path, ": ", what, "; the database of jobs is damaged. Stop here and keep a copy of ",
      directory_, ". Then restore ", path,
      " from a backup (without its -wal and -shm files), or move ", directory_,
      " away, start anew and submit the unfinished scenes again; finished images are in ",
      directory_, "/outputs in any case. Where SQLite's shell has .recover (Debian 12's has not), ",
      "\"sqlite3 ", path, " .recover | sqlite3 recovered.db\" may save more"));
}

// If the file is empty, SQLite would silently create a new database in it.
absl::Status SqliteJobStore::RefuseEmptied() const {
  std::error_code error;
  const bool emptied = std::filesystem::file_size(DatabasePath(), error) == 0 && !error;
  if (!emptied) return absl::OkStatus();
  for (const char* folder : {"/parts", "/outputs"}) {
    if (std::filesystem::is_empty(directory_ + folder, error) || error) continue;
    return absl::DataLossError(
        absl::StrCat("the file is empty, but ", directory_, folder, " holds data of earlier jobs"));
  }
  return absl::OkStatus();
}

absl::Status SqliteJobStore::Initialize() {
  if (absl::Status status = RefuseEmptied(); !status.ok()) return status;
  absl::StatusOr<std::unique_ptr<SqliteDatabase>> database =
      SqliteDatabase::Open(DatabasePath(), durability_);
  if (!database.ok()) return database.status();
  if (parts_ == nullptr) {
    absl::StatusOr<std::unique_ptr<FolderObjects>> files =
        FolderObjects::Open(directory_ + "/parts", durability_ == Durability::kPowerLoss);
    if (!files.ok()) return files.status();
    own_parts_ = *std::move(files);
    parts_ = own_parts_.get();
  }
  const MutexLock lock(&database_mutex_);
  database_ = std::move(*database);
  if (absl::Status status = database_->Check(kCheckTimeMax); !status.ok()) return status;
  if (absl::Status status = MigrateSchema(database_.get(), DatabasePath()); !status.ok()) {
    return status;
  }
  if (absl::Status status = CheckSchema(database_.get()); !status.ok()) return status;
  lost_commits_ = database_->lost_commits();
  if (lost_commits_ > 0) {
    LogError(absl::StrCat(
        DatabasePath(), "-wal: bits changed in the log of the database. Up to ", lost_commits_,
        " of the last changes are lost: their parts are rendered again, but jobs, refinements, "
        "pauses and the like that were asked for last may have to be asked for again. Check the "
        "disk"));
  }
  // The lives that are lost had lease ids, too; each made a commit.
  absl::Status status = database_->Prepare("UPDATE meta SET value = value + ? WHERE key = 'lives'")
                            .Bind(1 + lost_commits_)
                            .Run();
  if (!status.ok()) return status;
  SqliteStatement lives = database_->Prepare("SELECT value FROM meta WHERE key = 'lives'");
  const absl::StatusOr<bool> row = lives.Step();
  if (!row.ok()) return row.status();
  if (!*row) return absl::DataLossError("the table of lives is empty");
  first_lease_id_ = static_cast<uint64_t>(lives.Int64(0)) << kLeaseIdBitsPerLife;
  SqliteStatement bytes = database_->Prepare("SELECT COALESCE(SUM(size_bytes), 0) FROM parts");
  const absl::StatusOr<bool> sum = bytes.Step();
  if (!sum.ok()) return sum.status();
  parts_bytes_ = static_cast<uint64_t>(bytes.Int64(0));
  if (absl::Status found = FindUsedJobIds(); !found.ok()) return found;
  return FinishRemovals();
}

absl::Status SqliteJobStore::FindUsedJobIds() {
  const auto note = [this](const std::string& name) ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_) {
    uint64_t job_id = 0;
    if (absl::SimpleAtoi(name, &job_id)) NoteUsedJobId(job_id);
  };
  const absl::StatusOr<std::vector<std::string>> of_parts = parts_->ListFolders("");
  if (!of_parts.ok()) return of_parts.status();
  for (const std::string& name : *of_parts) note(name);
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(directory_ + "/outputs", ignored)) {
    note(entry.path().filename().string());
  }
  return absl::OkStatus();
}

void SqliteJobStore::NoteUsedJobId(uint64_t job_id) {
  uint64_t& next = IsPilot(job_id) ? next_pilot_id_ : next_job_id_;
  next = std::max(next, job_id + 1);
}

absl::Status SqliteJobStore::Probe() {
  const absl::Status written =
      parts_->Put(kProbeName, std::string(kProbeBytes, '\0'), PutMode::kReplace);
  if (!written.ok()) return written;
  parts_->Remove(kProbeName).IgnoreError();  // The next one replaces it.
  const MutexLock lock(&database_mutex_);
  return database_->Execute("UPDATE meta SET value = value WHERE key = 'lives'");
}

}  // namespace sheaf::coordinator
