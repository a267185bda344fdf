// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/sql_job_store.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "common/base/file.h"
#include "coordinator/store/row_columns.h"
#include "coordinator/store/stored_rows.h"
#include "coordinator/store/stored_times.h"

namespace sheaf::coordinator {

std::string SqlJobStore::FolderOf(const FrameId& frame) {
  return absl::StrCat(frame.job_id, "/", frame.frame_number, "/");
}

std::string SqlJobStore::NameOf(const PartRow& row) {
  const PixelRect& t = row.key.tile;
  return absl::StrCat(FolderOf(row.key.frame), t.x0, "_", t.y0, "_", t.x1, "_", t.y1, "-",
                      row.key.block.first, "-", row.key.block.count, "-",
                      row.digest.sha256_hex.substr(0, 16),
                      row.key.kind == TaskKind::kTraining ? ".field" : ".exr");
}

std::string SqlJobStore::PartPath(const PartRow& row) const {
  return absl::StrCat(directory_, "/parts/", NameOf(row));
}

absl::Status SqlJobStore::LoadFrames(StoredJob* job) {
  Statement query = database_->Prepare(
      absl::StrCat(SelectFrom<FrameRow>("frames"), "WHERE job_id = ? ORDER BY frame_number"));
  query.Bind(job->spec.job_id);
  return ReadRows<FrameRow>(&query, [job](FrameRow row) -> absl::Status {
    FrameSpec& frame = row.wanted.row.spec;
    if (!row.wanted.IsWhole()) {
      job->damage = absl::StrCat("the row of frame ", frame.frame_number);
      frame.scene.sha256_hex = frame.frame_digest = Sha256Hex("");  // The job's end needs some.
    }
    if (!IsSha256Hex(frame.scene.sha256_hex) || !IsSha256Hex(frame.frame_digest)) {
      return absl::DataLossError("a stored frame has an invalid digest");
    }
    FrameSettings& settings = frame.settings;
    settings.lattice = LatticeOf(settings.lattice.stride_px, settings.seed);
    if (row.delivered.delivered) {
      job->delivered.push_back({frame.frame_number, std::move(row.delivered.frame)});
    }
    if (row.correction_count > 0) job->corrections[frame.frame_number] = row.correction_count;
    job->spec.frames.push_back(std::move(frame));
    return absl::OkStatus();
  });
}

absl::StatusOr<std::vector<StoredJob>> SqlJobStore::LoadJobs() {
  const MutexLock lock(&database_mutex_);
  absl::StatusOr<std::vector<StoredJob>> jobs = ReadJobs();
  if (!jobs.ok()) return Explained(jobs.status());
  return jobs;
}

absl::StatusOr<std::vector<StoredJob>> SqlJobStore::ReadJobs() {
  std::vector<StoredJob> jobs;
  Statement query = database_->Prepare(absl::StrCat(SelectFrom<JobRow>("jobs"), "ORDER BY job_id"));
  absl::Status read = ReadRows<JobRow>(&query, [&jobs](JobRow row) {
    if (row.seal != kNoSeal && row.seal != SealOf(row.job)) row.job.damage = "the job's row";
    if (row.state_seal != kNoSeal && row.state_seal != SealOfState(row.job)) {
      row.job.damage = "the job's state";
    }
    jobs.push_back(std::move(row.job));
    return absl::OkStatus();
  });
  if (!read.ok()) return read;
  for (StoredJob& job : jobs) {
    if (absl::Status status = LoadFrames(&job); !status.ok()) return status;
  }
  std::map<uint64_t, StoredJob*> by_id;
  for (StoredJob& job : jobs) by_id[job.spec.job_id] = &job;
  if (absl::Status status = LoadEffects(by_id); !status.ok()) return status;
  if (absl::Status status = LoadFailures(by_id); !status.ok()) return status;
  if (absl::Status status = LoadHolds(by_id); !status.ok()) return status;
  for (StoredJob& job : jobs) {
    absl::StatusOr<std::vector<TaskTrouble>> troubles = ReadTroubles(job.spec.job_id);
    if (!troubles.ok()) return troubles.status();
    job.troubles = *std::move(troubles);
  }
  return jobs;
}

absl::StatusOr<JobStore::LoadedParts> SqlJobStore::LoadParts(uint64_t job_id) {
  LoadedParts loaded;
  std::vector<PartRow> rows;
  {
    const MutexLock lock(&database_mutex_);
    Statement query =
        database_->Prepare(absl::StrCat(SelectFrom<Sealed<PartRow>>("parts"), "WHERE job_id = ?"));
    query.Bind(job_id);
    absl::StatusOr<std::vector<PartRow>> all = ReadPartRows(&query, &loaded.lost);
    if (!all.ok()) return all.status();
    rows = std::move(*all);
  }
  std::map<std::string, uint64_t> stored;  // Sizes by name.
  absl::Status listed = parts_->List(
      absl::StrCat(job_id, "/"),
      [&stored](const StoredObject& object) { stored[object.key] = object.size_bytes; });
  if (!listed.ok()) return listed;
  std::set<std::string> known, lost;
  for (const PartRow& row : loaded.lost) lost.insert(NameOf(row));
  for (PartRow& row : rows) {
    const std::string name = NameOf(row);
    const auto object = stored.find(name);
    if (object == stored.end() || object->second != row.digest.size_bytes) {
      lost.insert(name);
      loaded.lost.push_back(std::move(row));
      continue;
    }
    known.insert(name);
    loaded.rows.push_back(std::move(row));
  }
  for (const auto& [name, size_bytes] : stored) {
    if (known.contains(name)) continue;
    if (!lost.contains(name) && name.ends_with(".exr")) ++loaded.files_without_row;
    parts_->Remove(name).IgnoreError();  // Nothing reads it.
  }
  return loaded;
}

absl::StatusOr<std::optional<uint64_t>> SqlJobStore::FindRequest(const std::string& request_id) {
  const MutexLock lock(&database_mutex_);
  Statement query = database_->Prepare("SELECT job_id FROM jobs WHERE request_id = ?");
  const absl::StatusOr<bool> row = query.Bind(request_id).Step();
  if (!row.ok()) return row.status();
  if (!*row) return std::optional<uint64_t>();
  return std::optional<uint64_t>(static_cast<uint64_t>(query.Int64(0)));
}

absl::StatusOr<JobStore::CreatedJob> SqlJobStore::CreateJob(const JobSpec& spec,
                                                            const std::string& request_id,
                                                            absl::Time create_time) {
  const absl::StatusOr<std::optional<uint64_t>> existing = FindRequest(request_id);
  if (!existing.ok()) return existing.status();
  if (existing->has_value()) return CreatedJob{**existing, false};
  const MutexLock lock(&database_mutex_);
  absl::StatusOr<CreatedJob> created;
  absl::Status status = InTransaction([&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_) {
    created = InsertJob(spec, request_id, create_time);
    return created.status();
  });
  if (!status.ok()) return status;
  return created;
}

absl::StatusOr<JobStore::CreatedJob> SqlJobStore::InsertJob(const JobSpec& spec,
                                                            const std::string& request_id,
                                                            absl::Time create_time) {
  Statement last = database_->Prepare(absl::StrCat("SELECT COALESCE(MAX(job_id), 0) FROM jobs ",
                                                   "WHERE job_id ", spec.pilot ? ">=" : "<", " ?"));
  const absl::StatusOr<bool> row = last.Bind(kFirstPilotId).Step();
  if (!row.ok()) return row.status();
  StoredJob job;
  job.spec = spec;
  job.spec.job_id = std::max(static_cast<uint64_t>(last.Int64(0)) + 1,
                             spec.pilot ? next_pilot_id_ : next_job_id_);
  job.request_id = request_id;
  job.create_time = create_time;
  Statement insert = database_->Prepare(absl::StrCat("INSERT ", IntoTable<JobRow>("jobs")));
  absl::Status status = BindRow(JobRow{job, SealOf(job), SealOfState(job)}, &insert).Run();
  if (!status.ok()) return status;
  if (status = InsertFrames(job.spec.job_id, spec.frames); !status.ok()) return status;
  if (status = InsertEffects(job.spec.job_id, spec.effect_costs); !status.ok()) return status;
  if (status = InsertHolds(job.spec.job_id, spec); !status.ok()) return status;
  return CreatedJob{job.spec.job_id, true};
}

absl::Status SqlJobStore::InsertFrames(uint64_t job_id, const std::vector<FrameSpec>& frames) {
  Statement insert =
      database_->Prepare(absl::StrCat("INSERT ", IntoTable<Sealed<FrameSpecRow>>("frames")));
  for (const FrameSpec& frame : frames) {
    absl::Status status = BindRow(Seal(FrameSpecRow{job_id, frame}), &insert).Run();
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::Status SqlJobStore::InTransaction(const std::function<absl::Status()>& body) {
  return database_->InTransaction(body);
}

absl::StatusOr<std::string> SqlJobStore::OutputPath(const FrameId& frame) {
  const std::string directory = absl::StrCat(directory_, "/outputs/", frame.job_id);
  if (absl::Status status = MakeDirectories(directory); !status.ok()) return status;
  return absl::StrCat(directory, "/", frame.frame_number, ".exr");
}

absl::Status SqlJobStore::DeliverFrame(const FrameId& frame, const DeliveredFrame& delivered) {
  std::error_code error;
  const std::string path =
      absl::StrCat(directory_, "/outputs/", frame.job_id, "/", frame.frame_number, ".exr");
  const uintmax_t image_bytes = std::filesystem::file_size(path, error);
  const MutexLock lock(&database_mutex_);
  return InTransaction([&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_) {
    Statement update = database_->Prepare(
        absl::StrCat(UpdateOf<DeliveredRow>("frames"), "WHERE job_id = ? AND frame_number = ?"));
    absl::Status status = BindRow(DeliveredRow{true, delivered}, &update)
                              .Bind(frame.job_id)
                              .Bind(frame.frame_number)
                              .Run();
    if (!status.ok()) return status;
    return AddUsage({frame.job_id}, {.image_bytes = error ? 0 : image_bytes});
  });
}

}  // namespace sheaf::coordinator
