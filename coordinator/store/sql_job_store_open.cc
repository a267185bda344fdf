// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SqlJobStore begins and cleans up: lock, integrity check, schema; the files of removed jobs, whose
// rows go first: a stop in between leaves files without rows, which the next start removes; and the
// test whether the disk accepts writes.
#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <set>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "common/base/file.h"
#include "common/base/log.h"
#include "common/base/status.h"
#include "common/objects/folder_objects.h"
#include "coordinator/store/database/sqlite_database.h"
#include "coordinator/store/disk_reserve.h"
#include "coordinator/store/job_rows.h"
#include "coordinator/store/job_schema.h"
#include "coordinator/store/part_rows.h"
#include "coordinator/store/sql_job_store.h"

namespace sheaf::coordinator {
namespace {

// Lease ids of one run are below those of the next; a run grants at most as many leases as this
// many bits count.
constexpr int kLeaseIdBitsPerLife = 40;
// Time limit for checking the database at a start; it suffices for hundreds of megabytes.
constexpr absl::Duration kCheckTimeMax = absl::Seconds(2);

// Takes the lock that excludes a second coordinator; shared: excludes only one that has its
// database here. The system releases it when the process ends.
absl::StatusOr<int> LockDirectory(const std::string& directory, bool shared) {
  const std::string path = directory + "/lock";
  const int fd = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (fd < 0) return StatusFromErrno(errno, path);
  if (::flock(fd, (shared ? LOCK_SH : LOCK_EX) | LOCK_NB) == 0) return fd;
  const int error = errno;
  ::close(fd);
  if (error != EWOULDBLOCK) return StatusFromErrno(error, path);
  return absl::FailedPreconditionError(
      directory + ": another coordinator uses this state directory; stop it or choose another one");
}

constexpr char kProbeName[] = "probe";

absl::Status MakeFolders(const std::string& directory) {
  for (const char* folder : {"/parts", "/outputs"}) {
    if (absl::Status status = MakePrivateDirectory(directory + folder); !status.ok()) return status;
  }
  return absl::OkStatus();
}

// Adds advice to the error of a damaged database.
absl::Status DamageError(const std::string& name, absl::string_view what,
                         const std::string& remedy) {
  absl::ConsumePrefix(&what, name + ": ");
  return absl::DataLossError(
      absl::StrCat(name, ": ", what, "; the database of jobs is damaged. ", remedy));
}

// If the file is empty, SQLite would silently create a new database in it.
absl::Status RefuseEmptied(const std::string& directory, const std::string& path) {
  std::error_code error;
  const bool emptied = std::filesystem::file_size(path, error) == 0 && !error;
  if (!emptied) return absl::OkStatus();
  for (const char* folder : {"/parts", "/outputs"}) {
    if (std::filesystem::is_empty(directory + folder, error) || error) continue;
    return absl::DataLossError(
        absl::StrCat("the file is empty, but ", directory, folder, " holds data of earlier jobs"));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<SqliteDatabase>> OpenFile(const std::string& directory,
                                                         Durability durability) {
  const std::string path = directory + "/farm.db";
  absl::Status status = RefuseEmptied(directory, path);
  if (status.ok()) {
    absl::StatusOr<std::unique_ptr<SqliteDatabase>> database =
        SqliteDatabase::Open(path, durability);
    if (database.ok()) return database;
    status = database.status();
  }
  if (!absl::IsDataLoss(status)) return status;
  return DamageError(path, status.message(), SqliteDatabase::RemedyFor(path, directory));
}

}  // namespace

absl::StatusOr<std::unique_ptr<SqlJobStore>> SqlJobStore::Open(const std::string& directory,
                                                               Durability durability,
                                                               ObjectStore* parts) {
  if (absl::Status status = MakeFolders(directory); !status.ok()) return status;
  const absl::StatusOr<int> lock = LockDirectory(directory, /*shared=*/false);
  if (!lock.ok()) return lock.status();
  MakeRoomForDatabase(directory);
  absl::StatusOr<std::unique_ptr<SqliteDatabase>> database = OpenFile(directory, durability);
  if (!database.ok()) {
    ::close(*lock);
    return database.status();
  }
  std::unique_ptr<SqlJobStore> store(
      new SqlJobStore(directory, durability, *lock, *std::move(database), /*shared=*/false, parts));
  if (absl::Status status = store->Initialize(); !status.ok()) return status;
  return store;
}

absl::StatusOr<std::unique_ptr<SqlJobStore>> SqlJobStore::Open(const std::string& directory,
                                                               std::unique_ptr<Database> database,
                                                               Durability durability,
                                                               ObjectStore* parts) {
  if (absl::Status status = MakeFolders(directory); !status.ok()) return status;
  const absl::StatusOr<int> lock = LockDirectory(directory, /*shared=*/true);
  if (!lock.ok()) return lock.status();
  std::unique_ptr<SqlJobStore> store(
      new SqlJobStore(directory, durability, *lock, std::move(database), /*shared=*/true, parts));
  if (absl::Status status = store->Initialize(); !status.ok()) return status;
  return store;
}

SqlJobStore::~SqlJobStore() {
  {
    const MutexLock lock(&database_mutex_);
    database_.reset();
  }
  ::close(lock_fd_);
}

absl::Status SqlJobStore::Explained(const absl::Status& status) const {
  if (!absl::IsDataLoss(status)) return status;
  return DamageError(database_->Name(), status.message(), database_->Remedy(directory_));
}

absl::Status SqlJobStore::Initialize() {
  if (parts_ == nullptr) {
    absl::StatusOr<std::unique_ptr<FolderObjects>> files =
        FolderObjects::Open(directory_ + "/parts", durability_ == Durability::kPowerLoss);
    if (!files.ok()) return files.status();
    own_parts_ = *std::move(files);
    parts_ = own_parts_.get();
  }
  const MutexLock lock(&database_mutex_);
  return Explained(BeginLife());
}

absl::Status SqlJobStore::BeginLife() {
  if (absl::Status status = database_->Check(kCheckTimeMax); !status.ok()) return status;
  if (absl::Status status = UpdateSchema(database_.get()); !status.ok()) return status;
  if (absl::Status status = CheckSchema(database_.get()); !status.ok()) return status;
  lost_commits_ = database_->LostCommits();
  if (lost_commits_ > 0) {
    LogError(absl::StrCat(
        database_->Name(), "-wal: bits changed in the log of the database. Up to ", lost_commits_,
        " of the last changes are lost: their parts are rendered again, but jobs, refinements, "
        "pauses and the like may have to be requested again. Check the disk"));
  }
  // Lost runs gave lease ids, too; each run made a commit.
  absl::Status status = database_->Prepare("UPDATE meta SET value = value + ? WHERE key = 'lives'")
                            .Bind(1 + lost_commits_)
                            .Run();
  if (!status.ok()) return status;
  Statement lives = database_->Prepare("SELECT value FROM meta WHERE key = 'lives'");
  const absl::StatusOr<bool> row = lives.Step();
  if (!row.ok()) return row.status();
  if (!*row) return absl::DataLossError("the count of runs is missing");
  first_lease_id_ = static_cast<uint64_t>(lives.Int64(0)) << kLeaseIdBitsPerLife;
  const absl::StatusOr<uint64_t> bytes = rows::PartsBytes(database_.get());
  if (!bytes.ok()) return bytes.status();
  parts_bytes_ = *bytes;
  if (absl::Status found = FindUsedJobIds(); !found.ok()) return found;
  return FinishRemovals();
}

absl::Status SqlJobStore::FindUsedJobIds() {
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

void SqlJobStore::NoteUsedJobId(uint64_t job_id) {
  uint64_t& next = IsPilot(job_id) ? next_pilot_id_ : next_job_id_;
  next = std::max(next, job_id + 1);
}

absl::Status SqlJobStore::RemoveJob(uint64_t job_id) {
  {
    const MutexLock lock(&database_mutex_);
    uint64_t parts_bytes = 0;
    absl::Status removed =
        database_->InTransaction([&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_) {
          return rows::RemoveJob(job_id, &parts_bytes, database_.get());
        });
    if (!removed.ok()) return removed;
    parts_bytes_ -= std::min<uint64_t>(parts_bytes, parts_bytes_);
    NoteUsedJobId(job_id);
  }
  absl::Status status = RemoveFilesOf(job_id);
  if (status.ok()) {
    const MutexLock lock(&database_mutex_);
    status = rows::NoteFilesRemoved(job_id, database_.get());
  }
  if (!status.ok()) {
    LogWarning(absl::StrCat("job ", job_id, " is removed, but files of it are left until the next ",
                            "start: ", status.message()));
  }
  return absl::OkStatus();
}

absl::Status SqlJobStore::RemoveFilesOf(uint64_t job_id) {
  absl::Status status = parts_->RemoveFolder(absl::StrCat(job_id, "/"));
  if (!status.ok()) return status;
  std::error_code error;
  const std::string images = absl::StrCat(directory_, "/outputs/", job_id);
  std::filesystem::remove_all(images, error);
  if (error) return absl::UnavailableError(absl::StrCat(images, ": ", error.message()));
  return absl::OkStatus();
}

absl::Status SqlJobStore::FinishRemovals() {
  const absl::StatusOr<std::vector<uint64_t>> removed = rows::RemovedJobs(database_.get());
  if (!removed.ok()) return removed.status();
  for (const uint64_t job_id : *removed) {
    NoteUsedJobId(job_id);
    absl::Status status = RemoveFilesOf(job_id);
    if (status.ok()) status = rows::NoteFilesRemoved(job_id, database_.get());
    if (!status.ok()) LogWarning(absl::StrCat("removing what is left: ", status.message()));
  }
  // For unfinished jobs, LoadParts checks each part.
  const absl::StatusOr<std::vector<uint64_t>> ended = rows::EndedJobs(database_.get());
  if (!ended.ok()) return ended.status();
  const std::set<uint64_t> ended_ids(ended->begin(), ended->end());
  const absl::StatusOr<std::vector<std::string>> jobs = parts_->ListFolders("");
  if (!jobs.ok()) return jobs.status();
  for (const std::string& job : *jobs) {
    uint64_t job_id = 0;
    if (!absl::SimpleAtoi(job, &job_id) || !ended_ids.contains(job_id)) continue;
    if (absl::Status status = RemoveFramesWithoutParts(job_id); !status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::Status SqlJobStore::RemoveFramesWithoutParts(uint64_t job_id) {
  const std::string folder = absl::StrCat(job_id, "/");
  const absl::StatusOr<std::vector<std::string>> frames = parts_->ListFolders(folder);
  if (!frames.ok()) return frames.status();
  absl::Status removed;
  if (frames->empty()) removed = parts_->RemoveFolder(folder);
  for (const std::string& frame : *frames) {
    int32_t number = 0;
    if (!absl::SimpleAtoi(frame, &number)) continue;
    const absl::StatusOr<bool> has_parts = rows::HasParts({job_id, number}, database_.get());
    if (!has_parts.ok()) return has_parts.status();
    if (!*has_parts) removed.Update(parts_->RemoveFolder(absl::StrCat(folder, frame, "/")));
  }
  if (!removed.ok()) LogWarning(absl::StrCat("removing what is left: ", removed.message()));
  return absl::OkStatus();
}

absl::Status SqlJobStore::Probe() {
  const absl::Status written =
      parts_->Put(kProbeName, std::string(kProbeBytes, '\0'), PutMode::kReplace);
  if (!written.ok()) return written;
  parts_->Remove(kProbeName).IgnoreError();  // The next one replaces it.
  const MutexLock lock(&database_mutex_);
  return database_->Execute("UPDATE meta SET value = value WHERE key = 'lives'");
}

}  // namespace sheaf::coordinator
