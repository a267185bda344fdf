// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/job_rows.h"

#include <algorithm>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/base/digest.h"
#include "coordinator/store/failure_rows.h"
#include "coordinator/store/hold_rows.h"
#include "coordinator/store/round_rows.h"
#include "coordinator/store/row_columns.h"
#include "coordinator/store/stored_rows.h"
#include "coordinator/store/stored_times.h"

namespace sheaf::coordinator::rows {
namespace {

absl::Status LoadFrames(StoredJob* job, Database* database) {
  Statement query = database->Prepare(
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

// Ignores rows of other jobs.
absl::Status LoadEffects(const std::map<uint64_t, StoredJob*>& jobs, Database* database) {
  Statement query = database->Prepare(
      absl::StrCat(SelectFrom<EffectRow>("effects"), "ORDER BY job_id, position"));
  return ReadRows<EffectRow>(&query, [&jobs](EffectRow row) {
    const auto job = jobs.find(row.job_id);
    if (job != jobs.end()) job->second->spec.effect_costs.push_back(std::move(row.cost));
    return absl::OkStatus();
  });
}

absl::Status InsertEffects(uint64_t job_id, const std::vector<EffectCost>& effects,
                           Database* database) {
  Statement insert = database->Prepare(absl::StrCat("INSERT ", IntoTable<EffectRow>("effects")));
  int64_t position = 0;
  for (const EffectCost& effect : effects) {
    absl::Status status = BindRow(EffectRow{job_id, position++, effect}, &insert).Run();
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::Status InsertFrames(uint64_t job_id, const std::vector<FrameSpec>& frames,
                          Database* database) {
  Statement insert =
      database->Prepare(absl::StrCat("INSERT ", IntoTable<Sealed<FrameSpecRow>>("frames")));
  for (const FrameSpec& frame : frames) {
    absl::Status status = BindRow(Seal(FrameSpecRow{job_id, frame}), &insert).Run();
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

// Seals the state of the job as it is now: after each change to it, in the same transaction.
absl::Status SealState(uint64_t job_id, Database* database) {
  Statement query = database->Prepare(absl::StrCat(SelectFrom<JobRow>("jobs"), "WHERE job_id = ?"));
  query.Bind(job_id);
  int64_t seal = kNoSeal;
  absl::Status status = ReadRows<JobRow>(&query, [&seal](JobRow row) {
    seal = SealOfState(row.job);
    return absl::OkStatus();
  });
  if (!status.ok()) return status;
  return database->Prepare("UPDATE jobs SET state_seal = ? WHERE job_id = ?")
      .Bind(seal)
      .Bind(job_id)
      .Run();
}

// Runs an UPDATE of the job's state, whose last parameter is the job's id, and seals it.
absl::Status ChangeState(uint64_t job_id, Statement* update, Database* database) {
  return database->InTransaction([&]() {
    absl::Status status = update->Bind(job_id).Run();
    return status.ok() ? SealState(job_id, database) : status;
  });
}

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

absl::StatusOr<std::vector<StoredJob>> LoadJobs(Database* database) {
  std::vector<StoredJob> jobs;
  Statement query = database->Prepare(absl::StrCat(SelectFrom<JobRow>("jobs"), "ORDER BY job_id"));
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
    if (absl::Status status = LoadFrames(&job, database); !status.ok()) return status;
  }
  std::map<uint64_t, StoredJob*> by_id;
  for (StoredJob& job : jobs) by_id[job.spec.job_id] = &job;
  if (absl::Status status = LoadEffects(by_id, database); !status.ok()) return status;
  if (absl::Status status = LoadFailures(by_id, database); !status.ok()) return status;
  if (absl::Status status = LoadHolds(by_id, database); !status.ok()) return status;
  for (StoredJob& job : jobs) {
    absl::StatusOr<std::vector<TaskTrouble>> troubles = LoadTroubles(job.spec.job_id, database);
    if (!troubles.ok()) return troubles.status();
    job.troubles = *std::move(troubles);
  }
  return jobs;
}

absl::StatusOr<std::optional<uint64_t>> FindRequest(const std::string& request_id,
                                                    Database* database) {
  Statement query = database->Prepare("SELECT job_id FROM jobs WHERE request_id = ?");
  const absl::StatusOr<bool> row = query.Bind(request_id).Step();
  if (!row.ok()) return row.status();
  if (!*row) return std::optional<uint64_t>();
  return std::optional<uint64_t>(static_cast<uint64_t>(query.Int64(0)));
}

absl::StatusOr<JobStore::CreatedJob> InsertJob(const JobSpec& spec, const std::string& request_id,
                                               absl::Time create_time, uint64_t id_min,
                                               Database* database) {
  Statement last = database->Prepare(absl::StrCat("SELECT COALESCE(MAX(job_id), 0) FROM jobs ",
                                                  "WHERE job_id ", spec.pilot ? ">=" : "<", " ?"));
  const absl::StatusOr<bool> row = last.Bind(kFirstPilotId).Step();
  if (!row.ok()) return row.status();
  StoredJob job;
  job.spec = spec;
  job.spec.job_id = std::max(static_cast<uint64_t>(last.Int64(0)) + 1, id_min);
  job.request_id = request_id;
  job.create_time = create_time;
  Statement insert = database->Prepare(absl::StrCat("INSERT ", IntoTable<JobRow>("jobs")));
  absl::Status status = BindRow(JobRow{job, SealOf(job), SealOfState(job)}, &insert).Run();
  if (!status.ok()) return status;
  if (status = InsertFrames(job.spec.job_id, spec.frames, database); !status.ok()) return status;
  if (status = InsertEffects(job.spec.job_id, spec.effect_costs, database); !status.ok())
    return status;
  if (status = InsertHolds(job.spec.job_id, spec, database); !status.ok()) return status;
  return JobStore::CreatedJob{job.spec.job_id, true};
}

absl::Status EndJob(uint64_t job_id, JobPhase phase, const std::string& failure,
                    absl::Time end_time, absl::Duration wall, Database* database) {
  Statement update = database->Prepare(
      "UPDATE jobs SET phase = ?, failure = ?, end_ns = ?, wall_ns = ?, paused = 0 "
      "WHERE job_id = ?");
  update.Bind(static_cast<int32_t>(phase))
      .Bind(failure)
      .Bind(ToNanoseconds(end_time))
      .Bind(ToNanoseconds(wall));
  return ChangeState(job_id, &update, database);
}

absl::Status ChangeJob(uint64_t job_id, const JobChange& change, Database* database) {
  std::vector<std::string> columns;
  if (change.paused) columns.push_back("paused = ?");
  if (change.priority) columns.push_back("priority = ?");
  if (change.pinned) columns.push_back("pinned = ?");
  if (change.parts_removed_time) columns.push_back("parts_removed_ns = ?");
  if (columns.empty()) return absl::OkStatus();
  Statement update = database->Prepare(
      absl::StrCat("UPDATE jobs SET ", absl::StrJoin(columns, ", "), " WHERE job_id = ?"));
  if (change.paused) update.Bind(int64_t{*change.paused});
  if (change.priority) update.Bind(*change.priority);
  if (change.pinned) update.Bind(int64_t{*change.pinned});
  if (change.parts_removed_time) update.Bind(ToNanoseconds(*change.parts_removed_time));
  return ChangeState(job_id, &update, database);
}

absl::Status SetWarning(uint64_t job_id, const std::string& warning, Database* database) {
  return database->Prepare("UPDATE jobs SET warning = ? WHERE job_id = ?")
      .Bind(warning)
      .Bind(job_id)
      .Run();
}

absl::Status DeliverFrame(const FrameId& frame, const DeliveredFrame& delivered,
                          Database* database) {
  Statement update = database->Prepare(
      absl::StrCat(UpdateOf<DeliveredRow>("frames"), "WHERE job_id = ? AND frame_number = ?"));
  return BindRow(DeliveredRow{true, delivered}, &update)
      .Bind(frame.job_id)
      .Bind(frame.frame_number)
      .Run();
}

absl::Status ReopenJob(uint64_t job_id, const std::vector<JobStore::ReopenedFrame>& frames,
                       Database* database) {
  return database->InTransaction([&]() -> absl::Status {
    absl::Status status =
        database
            ->Prepare(
                "UPDATE jobs SET phase = 0, failure = '', end_ns = ?1, parts_removed_ns = CASE "
                "WHEN (SELECT COUNT(*) FROM frames WHERE job_id = ?2) = ?3 THEN ?1 "
                "ELSE parts_removed_ns END WHERE job_id = ?2")
            .Bind(ToNanoseconds(absl::InfiniteFuture()))
            .Bind(job_id)
            .Bind(static_cast<int64_t>(frames.size()))
            .Run();
    if (status.ok()) status = SealState(job_id, database);
    for (const JobStore::ReopenedFrame& frame : frames) {
      if (!status.ok()) return status;
      const FrameId id{job_id, frame.spec.frame_number};
      status = database
                   ->Prepare(
                       "UPDATE frames SET correction_count = correction_count + 1 "
                       "WHERE job_id = ? AND frame_number = ? AND delivered = 1 AND ? = 1")
                   .Bind(job_id)
                   .Bind(id.frame_number)
                   .Bind(int64_t{frame.is_correction})
                   .Run();
      if (!status.ok()) return status;
      Statement update = database->Prepare(
          absl::StrCat(UpdateOf<ReopenedRow>("frames"), "WHERE job_id = ? AND frame_number = ?"));
      const int64_t seal = Seal(FrameSpecRow{job_id, frame.spec}).seal;
      status = BindRow(ReopenedRow{false, frame.spec.settings.samples, frame.spec.stop,
                                   frame.spec.resumed, seal},
                       &update)
                   .Bind(job_id)
                   .Bind(id.frame_number)
                   .Run();
      if (!status.ok()) return status;
      if (status = NoteApproval(id, frame.spec.settings.samples, database); !status.ok())
        return status;
      status = database->Prepare("DELETE FROM rounds WHERE job_id = ? AND frame_number = ?")
                   .Bind(job_id)
                   .Bind(id.frame_number)
                   .Run();
      for (const RoundRecord& round : frame.rounds) {
        if (status.ok()) status = InsertRound(id, round, database);
      }
    }
    return status;
  });
}

absl::Status RemoveJob(uint64_t job_id, uint64_t* parts_bytes, Database* database) {
  Statement sum = database->Prepare(
      "SELECT CAST(COALESCE(SUM(size_bytes), 0) AS BIGINT) FROM parts WHERE job_id = ?");
  const absl::StatusOr<bool> row = sum.Bind(job_id).Step();
  if (!row.ok()) return row.status();
  *parts_bytes = static_cast<uint64_t>(sum.Int64(0));
  absl::Status status =
      database->Prepare("INSERT INTO removed_jobs(job_id) VALUES(?) ON CONFLICT DO NOTHING")
          .Bind(job_id)
          .Run();
  for (const char* table : {"parts", "rounds", "effects", "failures", "task_failures", "job_events",
                            "frames", "jobs"}) {
    if (!status.ok()) return status;
    status = database->Prepare(absl::StrCat("DELETE FROM ", table, " WHERE job_id = ?"))
                 .Bind(job_id)
                 .Run();
  }
  return status.ok() ? RemoveHolds(job_id, database) : status;
}

absl::Status NoteFilesRemoved(uint64_t job_id, Database* database) {
  // The last id of its kind stays, so that it is not reused after a start.
  return database
      ->Prepare(
          "DELETE FROM removed_jobs WHERE job_id = ? AND job_id < (SELECT MAX(job_id) FROM "
          "removed_jobs WHERE (job_id >= ?) = (? >= ?))")
      .Bind(job_id)
      .Bind(kFirstPilotId)
      .Bind(job_id)
      .Bind(kFirstPilotId)
      .Run();
}

absl::StatusOr<std::vector<uint64_t>> RemovedJobs(Database* database) {
  return ReadIds(database->Prepare("SELECT job_id FROM removed_jobs"));
}

absl::StatusOr<std::vector<uint64_t>> EndedJobs(Database* database) {
  return ReadIds(database->Prepare("SELECT job_id FROM jobs WHERE phase != 0"));
}

}  // namespace sheaf::coordinator::rows
