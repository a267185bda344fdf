// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of SqlJobStore that removes data that is no longer kept. It removes rows first and files
// afterwards: a stop in between leaves files without rows, which the next start removes.
#include <algorithm>
#include <filesystem>
#include <set>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "coordinator/store/row_columns.h"
#include "coordinator/store/sql_job_store.h"
#include "coordinator/store/stored_times.h"

namespace sheaf::coordinator {
namespace {

namespace fs = std::filesystem;

// The first column of all rows, as ids. Errors: those of Step.
absl::StatusOr<std::vector<uint64_t>> ReadIds(Statement query) {
  std::vector<uint64_t> ids;
  while (true) {
    const absl::StatusOr<bool> row = query.Step();
    if (!row.ok()) return row.status();
    if (!*row) return ids;
    ids.push_back(static_cast<uint64_t>(query.Int64(0)));
  }
}

}  // namespace

absl::StatusOr<std::map<uint64_t, uint64_t>> SqlJobStore::PartsBytesByJob() {
  const MutexLock lock(&database_mutex_);
  std::map<uint64_t, uint64_t> bytes;
  Statement query = database_->Prepare(
      "SELECT job_id, CAST(SUM(size_bytes) AS BIGINT) FROM parts GROUP BY job_id");
  while (true) {
    const absl::StatusOr<bool> row = query.Step();
    if (!row.ok()) return row.status();
    if (!*row) return bytes;
    bytes[static_cast<uint64_t>(query.Int64(0))] = static_cast<uint64_t>(query.Int64(1));
  }
}

absl::Status SqlJobStore::RemoveJob(uint64_t job_id) {
  {
    const MutexLock lock(&database_mutex_);
    uint64_t parts_bytes = 0;
    absl::Status removed = InTransaction([&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_) {
      return RemoveRowsOf(job_id, &parts_bytes);
    });
    if (!removed.ok()) return removed;
    parts_bytes_ -= std::min<uint64_t>(parts_bytes, parts_bytes_);
    NoteUsedJobId(job_id);
  }
  absl::Status status = RemoveFilesOf(job_id);
  if (status.ok()) {
    const MutexLock lock(&database_mutex_);
    status = NoteFilesRemoved(job_id);
  }
  if (!status.ok()) {
    LogWarning(absl::StrCat("job ", job_id, " is removed, but files of it are left until the next ",
                            "start: ", status.message()));
  }
  return absl::OkStatus();
}

absl::Status SqlJobStore::RemoveRowsOf(uint64_t job_id, uint64_t* parts_bytes) {
  Statement sum = database_->Prepare(
      "SELECT CAST(COALESCE(SUM(size_bytes), 0) AS BIGINT) FROM parts WHERE job_id = ?");
  const absl::StatusOr<bool> row = sum.Bind(job_id).Step();
  if (!row.ok()) return row.status();
  *parts_bytes = static_cast<uint64_t>(sum.Int64(0));
  absl::Status status =
      database_->Prepare("INSERT INTO removed_jobs(job_id) VALUES(?) ON CONFLICT DO NOTHING")
          .Bind(job_id)
          .Run();
  for (const char* table :
       {"parts", "rounds", "effects", "failures", "task_failures", "frames", "jobs"}) {
    if (!status.ok()) return status;
    status = database_->Prepare(absl::StrCat("DELETE FROM ", table, " WHERE job_id = ?"))
                 .Bind(job_id)
                 .Run();
  }
  return status.ok() ? RemoveHolds(job_id) : status;
}

absl::Status SqlJobStore::RemoveFilesOf(uint64_t job_id) {
  absl::Status status = parts_->RemoveFolder(absl::StrCat(job_id, "/"));
  if (!status.ok()) return status;
  std::error_code error;
  const std::string images = absl::StrCat(directory_, "/outputs/", job_id);
  fs::remove_all(images, error);
  if (error) return absl::UnavailableError(absl::StrCat(images, ": ", error.message()));
  return absl::OkStatus();
}

absl::Status SqlJobStore::NoteFilesRemoved(uint64_t job_id) {
  // The last id of its kind stays, so that it is not reused after a start.
  return database_
      ->Prepare(
          "DELETE FROM removed_jobs WHERE job_id = ? AND job_id < (SELECT MAX(job_id) FROM "
          "removed_jobs WHERE (job_id >= ?) = (? >= ?))")
      .Bind(job_id)
      .Bind(kFirstPilotId)
      .Bind(job_id)
      .Bind(kFirstPilotId)
      .Run();
}

absl::Status SqlJobStore::FinishRemovals() {
  const absl::StatusOr<std::vector<uint64_t>> removed =
      ReadIds(database_->Prepare("SELECT job_id FROM removed_jobs"));
  if (!removed.ok()) return removed.status();
  for (const uint64_t job_id : *removed) {
    NoteUsedJobId(job_id);
    absl::Status status = RemoveFilesOf(job_id);
    if (status.ok()) status = NoteFilesRemoved(job_id);
    if (!status.ok()) LogWarning(absl::StrCat("removing what is left: ", status.message()));
  }
  // For unfinished jobs, LoadParts checks each part.
  const absl::StatusOr<std::vector<uint64_t>> ended =
      ReadIds(database_->Prepare("SELECT job_id FROM jobs WHERE phase != 0"));
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
  Statement any =
      database_->Prepare("SELECT 1 FROM parts WHERE job_id = ? AND frame_number = ? LIMIT 1");
  const std::string folder = absl::StrCat(job_id, "/");
  const absl::StatusOr<std::vector<std::string>> frames = parts_->ListFolders(folder);
  if (!frames.ok()) return frames.status();
  absl::Status removed;
  if (frames->empty()) removed = parts_->RemoveFolder(folder);
  for (const std::string& frame : *frames) {
    int32_t number = 0;
    if (!absl::SimpleAtoi(frame, &number)) continue;
    const absl::StatusOr<bool> has_parts = any.Bind(job_id).Bind(number).Step();
    if (!has_parts.ok()) return has_parts.status();
    if (!*has_parts) removed.Update(parts_->RemoveFolder(absl::StrCat(folder, frame, "/")));
  }
  if (!removed.ok()) LogWarning(absl::StrCat("removing what is left: ", removed.message()));
  return absl::OkStatus();
}

}  // namespace sheaf::coordinator
