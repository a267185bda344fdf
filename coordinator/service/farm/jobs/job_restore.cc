// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/jobs/job_restore.h"

#include <algorithm>
#include <chrono>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "coordinator/core/job/job_check.h"

namespace sheaf::coordinator {
namespace {

// By frame: its tiles with parts on disk.
using TilesOnDisk = std::map<FrameId, std::set<uint32_t>>;

std::vector<FrameSpec> UndeliveredOf(const StoredJob& job) {
  std::set<int32_t> delivered;
  for (const StoredFrame& frame : job.delivered) delivered.insert(frame.frame_number);
  std::vector<FrameSpec> frames;
  for (const FrameSpec& frame : job.spec.frames) {
    if (!delivered.contains(frame.frame_number)) frames.push_back(frame);
  }
  return frames;
}

// Errors: kDataLoss.
absl::Status CheckUndamaged(const StoredJob& job, const std::string& state_directory) {
  if (job.damage.empty()) return absl::OkStatus();
  return absl::DataLossError(absl::StrCat(
      state_directory, "/farm.db: ", job.damage, " of jobs/", job.spec.job_id,
      " changed since it was stored, so bits changed on disk and the image would differ; ",
      "submit the scene again, and check the disk"));
}

// By frame, the guiding field of its parts: the stored one, or the one named by its parts.
std::map<FrameId, BlobDigest> FieldsOf(const std::vector<PartRow>& rows) {
  std::map<FrameId, BlobDigest> fields;
  for (const PartRow& row : rows) {
    if (row.key.kind == TaskKind::kTraining) fields[row.key.frame] = row.digest;
  }
  for (const PartRow& row : rows) {
    if (!row.field.empty()) fields.try_emplace(row.key.frame, BlobDigest{row.field, 0});
  }
  return fields;
}

// Removes a part that conflicts with those before it: it was superseded while it was written and
// the disk refused to remove it, or its frame was refined.
void RemoveUnusable(JobContext& context, const PartRow& row, FrameTasks::Fit fit)
    ABSL_EXCLUSIVE_LOCKS_REQUIRED(context.tables.mutex) {
  // A part outside its frame belongs to a later round than the one from which a refined job
  // continues.
  if (fit != FrameTasks::Fit::kOutside) {
    ++context.tables.scheduler.counters().parts_revoked;
    LogWarning(absl::StrCat("job ", row.key.frame.job_id, ": a part of frame ",
                            row.key.frame.frame_number,
                            " overlaps another, or was made with another guiding field, and is "
                            "removed; samples that are lost with it are rendered again"));
  }
  context.removals.Remove({row});
}

// Requires: after AddJob, before the job's parts.
void RestoreRounds(JobContext& context, const StoredJob& job, std::vector<StoredRound> rounds)
    ABSL_EXCLUSIVE_LOCKS_REQUIRED(context.tables.mutex) {
  const bool live = job.phase == JobPhase::kLive;
  JobAccount& account = context.tables.accounts[job.spec.job_id];
  for (StoredRound& round : rounds) {
    std::vector<RoundRecord>& of_frame = account.rounds[round.frame_number];
    if (!of_frame.empty()) of_frame.back().cells.clear();
    account.wall_before[round.frame_number] = round.record.wall_duration;
    account.job_wall_before = std::max(account.job_wall_before, round.record.wall_duration);
    if (live && !round.record.samples_next.empty()) {
      const FrameId id{job.spec.job_id, round.frame_number};
      const FrameRecord* frame = context.tables.scheduler.FindFrame(id);
      if (frame != nullptr && frame->phase != FrameRecord::Phase::kDelivered) {
        context.tables.scheduler.RestoreRound(id, round.record.samples_next);
      }
    }
    of_frame.push_back(std::move(round.record));
  }
}

// Raises the cells to the samples that the resumed images have: after AddJob, before rounds.
void RestoreResumed(JobContext& context, uint64_t job_id, const ResumedCounts& resumed)
    ABSL_EXCLUSIVE_LOCKS_REQUIRED(context.tables.mutex) {
  for (const auto& [number, counts] : resumed) {
    context.tables.scheduler.RestoreRound({job_id, number}, counts);
  }
}

// Restores the parts that the resumed images replace: before other parts.
TilesOnDisk RestoreResumedParts(JobContext& context, uint64_t job_id, const ResumedCounts& resumed)
    ABSL_EXCLUSIVE_LOCKS_REQUIRED(context.tables.mutex) {
  TilesOnDisk on_disk;
  for (const auto& [number, counts] : resumed) {
    const FrameId id{job_id, number};
    const CellGrid& grid = context.tables.scheduler.FindFrame(id)->tasks->grid();
    for (uint32_t tile = 0; tile < grid.tiles().size(); ++tile) {
      for (uint32_t i = 0; i < grid.cell_count(tile); ++i) {
        const TileCells cell = grid.CellsOf(tile, uint64_t{1} << i);
        for (const SampleBlock& block : PrefixBlocks(counts[grid.first_cell(tile) + i])) {
          context.tables.scheduler.RestorePart(id, grid.tiles()[tile], block, cell, {});
        }
      }
      on_disk[id].insert(tile);
    }
    if (!grid.light_tile()) continue;
    // An image has as many light passes as its cell with the most samples (resumed_image.h).
    for (const SampleBlock& block : PrefixBlocks(std::ranges::max(counts))) {
      context.tables.scheduler.RestorePart(id, grid.RectOf(*grid.light_tile()), block, {}, {},
                                           TaskKind::kLight);
    }
    on_disk[id].insert(*grid.light_tile());
  }
  return on_disk;
}

void RestoreLiveJob(JobContext& context, const StoredJob& job, const JobStore::LoadedParts& parts,
                    TilesOnDisk on_disk) ABSL_EXCLUSIVE_LOCKS_REQUIRED(context.tables.mutex) {
  context.tables.scheduler.counters().parts_revoked += parts.lost.size();
  if (!parts.lost.empty()) {
    LogWarning(absl::StrCat("job ", job.spec.job_id, ": ", parts.lost.size(),
                            " parts are missing or changed on disk and will be rendered again"));
  }
  context.tables.scheduler.counters().parts_unrecorded +=
      static_cast<uint64_t>(parts.files_without_row);
  if (parts.files_without_row > 0) {
    LogInfo(absl::StrCat("job ", job.spec.job_id, ": ", parts.files_without_row,
                         " files of parts have no row; their samples are rendered again"));
  }
  const std::map<FrameId, BlobDigest> fields = FieldsOf(parts.rows);
  for (const PartRow& row : parts.rows) {
    const FrameRecord* frame = context.tables.scheduler.FindFrame(row.key.frame);
    const bool wanted = frame != nullptr && frame->phase != FrameRecord::Phase::kDelivered;
    if (!wanted) continue;  // Delivered, and stopped before its parts were removed.
    FrameTasks::Fit fit = FrameTasks::Fit::kPartial;
    const auto field = fields.find(row.key.frame);
    if (field != fields.end()) context.tables.scheduler.RestoreField(field->first, field->second);
    const bool is_field = row.key.kind == TaskKind::kTraining;
    const bool fits_field =
        is_field || row.field == (field == fields.end() ? "" : field->second.sha256_hex);
    if (fits_field) {
      fit = context.tables.scheduler.RestorePart(row.key.frame, row.key.tile, row.key.block,
                                                 row.key.cells, row.cost, row.key.kind);
    }
    if (fit != FrameTasks::Fit::kWanted) {
      RemoveUnusable(context, row, fit);
      continue;
    }
    std::set<uint32_t>& tiles = on_disk[row.key.frame];
    if (!is_field) tiles.insert(*frame->tasks->grid().FindTile(row.key.tile, row.key.kind));
  }
  for (const auto& [id, tiles] : on_disk) context.tables.Open(id, tiles);
  for (const TaskTrouble& trouble : job.troubles) context.tables.scheduler.RestoreTrouble(trouble);
  context.tables.NoteEndedJobs();  // It may have failed by that.
  for (const FrameSpec& spec : job.spec.frames) {
    const FrameId id{job.spec.job_id, spec.frame_number};
    if (context.tables.scheduler.FindFrame(id)->phase == FrameRecord::Phase::kRendered)
      context.queue.Add(id);
  }
  if (!parts.rows.empty()) {
    LogInfo(absl::StrCat("job ", job.spec.job_id, ": resumed with ", parts.rows.size(),
                         " results on disk"));
  }
  // All frames were delivered, but the coordinator was stopped before it stored the job's end.
  const JobRecord& record = context.tables.scheduler.jobs().at(job.spec.job_id);
  const bool is_done =
      job.delivered.size() == job.spec.frames.size() && record.unapproved_count == 0;
  if (is_done) {
    context.tables.scheduler.EndJob(job.spec.job_id, JobPhase::kSucceeded, "");
    context.tables.NoteEndedJobs();
  }
}

}  // namespace

absl::StatusOr<JobStore::LoadedParts> LoadPartsOf(JobContext& context, uint64_t job_id,
                                                  const std::vector<PartRow>& without) {
  PartKeys left = context.removals.Left();
  for (const PartRow& row : without) left.insert(row.key);
  absl::StatusOr<JobStore::LoadedParts> parts = context.store.LoadParts(job_id);
  if (!parts.ok()) return parts;
  const auto is_left = [&left](const PartRow& row) { return left.contains(row.key); };
  std::erase_if(parts->rows, is_left);
  std::erase_if(parts->lost, is_left);
  context.removals.Remove(parts->lost);
  return parts;
}

void RestoreJob(JobContext& context, const StoredJob& job, std::vector<StoredRound> rounds,
                const JobStore::LoadedParts* parts, const ResumedCounts& resumed) {
  context.tables.scheduler.AddJob(job.spec);
  context.tables.loads.clear();  // Forecasts know of it at once.
  context.tables.scheduler.RestoreFailures(job.spec.job_id, job.failures);
  JobAccount& account = context.tables.accounts[job.spec.job_id];
  account.job_wall_before = std::max(account.job_wall_before, job.wall_duration);
  for (const StoredFrame& frame : job.delivered) {
    account.job_wall_before = std::max(account.job_wall_before, frame.delivered.wall_duration);
    account.delivered[frame.frame_number] = frame.delivered;
    context.tables.scheduler.RestoreDelivered({job.spec.job_id, frame.frame_number},
                                              frame.delivered.cost, frame.delivered.sample_count);
  }
  RestoreResumed(context, job.spec.job_id, resumed);
  RestoreRounds(context, job, std::move(rounds));
  if (job.phase == JobPhase::kLive) {
    if (IsPilot(job.spec.job_id)) {
      context.tables.pilots_asked[job.spec.job_id] = std::chrono::steady_clock::now();
    }
    if (parts == nullptr) return;  // It cannot continue.
    TilesOnDisk on_disk = RestoreResumedParts(context, job.spec.job_id, resumed);
    if (job.paused) context.tables.scheduler.Pause(job.spec.job_id, SteadyTime::Now());
    RestoreLiveJob(context, job, *parts, std::move(on_disk));
    return;
  }
  context.tables.scheduler.RestoreEnded(job.spec.job_id, job.phase, job.failure);
  if (job.phase != JobPhase::kFailed) return;
  for (const TaskTrouble& trouble : job.troubles) context.tables.scheduler.RestoreTrouble(trouble);
}

absl::Status LoadJobs(JobContext& context) {
  const absl::StatusOr<std::vector<StoredJob>> jobs = context.store.LoadJobs();
  if (!jobs.ok()) return jobs.status();
  const absl::StatusOr<std::vector<QuarantineRecord>> quarantines = context.store.LoadQuarantines();
  if (!quarantines.ok()) return quarantines.status();
  const MutexLock lock(&context.tables.mutex);
  for (const QuarantineRecord& record : *quarantines) {
    context.tables.scheduler.RestoreQuarantine(record);
    // The last run may have ended before their parts were removed.
    if (record.made_false_results) context.tables.liars.push_back(record.identity);
  }
  for (const StoredJob& job : *jobs) {
    std::optional<JobStore::LoadedParts> parts;
    absl::StatusOr<ResumedCounts> resumed = ResumedCounts();
    if (job.phase == JobPhase::kLive) {
      if (absl::Status whole = CheckUndamaged(job, context.options.state_directory); !whole.ok()) {
        resumed = std::move(whole);
      } else if (absl::Status fits = CheckJobSpec(job.spec, context.options.limits); !fits.ok()) {
        resumed = std::move(fits);
      } else {
        resumed = context.resumed.Count(UndeliveredOf(job), job.spec.partition);
      }
      absl::StatusOr<JobStore::LoadedParts> loaded = LoadPartsOf(context, job.spec.job_id);
      if (!loaded.ok()) return loaded.status();
      parts = *std::move(loaded);
    }
    absl::StatusOr<std::vector<StoredRound>> rounds =
        context.store.LoadRounds(job.spec.job_id, /*with_cells=*/job.phase == JobPhase::kLive);
    if (!rounds.ok()) return rounds.status();
    JobAccount& account = context.tables.accounts[job.spec.job_id];
    account.create_time = job.create_time;
    account.end_time = job.end_time;
    account.warning = job.warning;
    account.corrections = job.corrections;
    account.pinned = job.pinned;
    account.parts_removed_time = job.parts_removed_time;
    RestoreJob(context, job, *std::move(rounds), parts && resumed.ok() ? &*parts : nullptr,
               resumed.ok() ? *resumed : ResumedCounts());
    if (resumed.ok()) continue;
    context.tables.scheduler.EndJob(job.spec.job_id, JobPhase::kFailed,
                                    std::string(resumed.status().message()));
    context.tables.NoteEndedJobs();
  }
  context.tables.scheduler.counters().commits_lost =
      static_cast<uint64_t>(context.store.LostCommits());
  return absl::OkStatus();
}

}  // namespace sheaf::coordinator
