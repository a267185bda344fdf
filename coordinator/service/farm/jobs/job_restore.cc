// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of JobLifecycle that restores stored jobs into the scheduler: after a start, when they
// are created, and when they are refined.
#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "coordinator/core/job/job_check.h"
#include "coordinator/service/farm/jobs/job_lifecycle.h"

namespace sheaf::coordinator {
namespace {

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

}  // namespace

absl::Status JobLifecycle::Load() {
  const absl::StatusOr<std::vector<StoredJob>> jobs = store_.LoadJobs();
  if (!jobs.ok()) return jobs.status();
  const absl::StatusOr<std::vector<QuarantineRecord>> quarantines = store_.LoadQuarantines();
  if (!quarantines.ok()) return quarantines.status();
  const MutexLock lock(&tables_.mutex);
  for (const QuarantineRecord& record : *quarantines) {
    tables_.scheduler.RestoreQuarantine(record);
    // The last run may have ended before their parts were removed.
    if (record.made_false_results) tables_.liars.push_back(record.identity);
  }
  for (const StoredJob& job : *jobs) {
    std::optional<JobStore::LoadedParts> parts;
    absl::StatusOr<ResumedCounts> resumed = ResumedCounts();
    if (job.phase == JobPhase::kLive) {
      if (absl::Status whole = CheckUndamaged(job, options_.state_directory); !whole.ok()) {
        resumed = std::move(whole);
      } else if (absl::Status fits = CheckJobSpec(job.spec, options_.limits); !fits.ok()) {
        resumed = std::move(fits);
      } else {
        resumed = resumed_.Count(UndeliveredOf(job), job.spec.partition);
      }
      absl::StatusOr<JobStore::LoadedParts> loaded = LoadPartsOf(job.spec.job_id);
      if (!loaded.ok()) return loaded.status();
      parts = *std::move(loaded);
    }
    absl::StatusOr<std::vector<StoredRound>> rounds =
        store_.LoadRounds(job.spec.job_id, /*with_cells=*/job.phase == JobPhase::kLive);
    if (!rounds.ok()) return rounds.status();
    JobAccount& account = tables_.accounts[job.spec.job_id];
    account.create_time = job.create_time;
    account.end_time = job.end_time;
    account.warning = job.warning;
    account.corrections = job.corrections;
    account.pinned = job.pinned;
    account.parts_removed_time = job.parts_removed_time;
    RestoreJob(job, *std::move(rounds), parts && resumed.ok() ? &*parts : nullptr,
               resumed.ok() ? *resumed : ResumedCounts());
    if (resumed.ok()) continue;
    tables_.scheduler.EndJob(job.spec.job_id, JobPhase::kFailed,
                             std::string(resumed.status().message()));
    tables_.NoteEndedJobs();
  }
  tables_.scheduler.counters().commits_lost = static_cast<uint64_t>(store_.LostCommits());
  return absl::OkStatus();
}

void JobLifecycle::RestoreJob(const StoredJob& job, std::vector<StoredRound> rounds,
                              const JobStore::LoadedParts* parts, const ResumedCounts& resumed) {
  tables_.scheduler.AddJob(job.spec);
  tables_.loads.clear();  // Forecasts know of it at once.
  tables_.scheduler.RestoreFailures(job.spec.job_id, job.failures);
  JobAccount& account = tables_.accounts[job.spec.job_id];
  account.job_wall_before = std::max(account.job_wall_before, job.wall_duration);
  for (const StoredFrame& frame : job.delivered) {
    account.job_wall_before = std::max(account.job_wall_before, frame.delivered.wall_duration);
    account.delivered[frame.frame_number] = frame.delivered;
    tables_.scheduler.RestoreDelivered({job.spec.job_id, frame.frame_number}, frame.delivered.cost,
                                       frame.delivered.sample_count);
  }
  RestoreResumed(job.spec.job_id, resumed);
  RestoreRounds(job, std::move(rounds));
  if (job.phase == JobPhase::kLive) {
    if (IsPilot(job.spec.job_id)) {
      tables_.pilots_asked[job.spec.job_id] = std::chrono::steady_clock::now();
    }
    if (parts == nullptr) return;  // It cannot continue.
    TilesOnDisk on_disk = RestoreResumedParts(job.spec.job_id, resumed);
    if (job.paused) tables_.scheduler.Pause(job.spec.job_id, SteadyTime::Now());
    RestoreLiveJob(job, *parts, std::move(on_disk));
    return;
  }
  tables_.scheduler.RestoreEnded(job.spec.job_id, job.phase, job.failure);
  if (job.phase != JobPhase::kFailed) return;
  for (const TaskTrouble& trouble : job.troubles) tables_.scheduler.RestoreTrouble(trouble);
}

void JobLifecycle::RestoreLiveJob(const StoredJob& job, const JobStore::LoadedParts& parts,
                                  TilesOnDisk on_disk) {
  tables_.scheduler.counters().parts_revoked += parts.lost.size();
  if (!parts.lost.empty()) {
    LogWarning(absl::StrCat("job ", job.spec.job_id, ": ", parts.lost.size(),
                            " parts are missing or changed on disk and will be rendered again"));
  }
  tables_.scheduler.counters().parts_unrecorded += static_cast<uint64_t>(parts.files_without_row);
  if (parts.files_without_row > 0) {
    LogInfo(absl::StrCat("job ", job.spec.job_id, ": ", parts.files_without_row,
                         " files of parts have no row; their samples are rendered again"));
  }
  const std::map<FrameId, BlobDigest> fields = FieldsOf(parts.rows);
  for (const PartRow& row : parts.rows) {
    const FrameRecord* frame = tables_.scheduler.FindFrame(row.key.frame);
    const bool wanted = frame != nullptr && frame->phase != FrameRecord::Phase::kDelivered;
    if (!wanted) continue;  // Delivered, and stopped before its parts were removed.
    FrameTasks::Fit fit = FrameTasks::Fit::kPartial;
    const auto field = fields.find(row.key.frame);
    if (field != fields.end()) tables_.scheduler.RestoreField(field->first, field->second);
    const bool is_field = row.key.kind == TaskKind::kTraining;
    const bool fits_field =
        is_field || row.field == (field == fields.end() ? "" : field->second.sha256_hex);
    if (fits_field) {
      fit = tables_.scheduler.RestorePart(row.key.frame, row.key.tile, row.key.block, row.key.cells,
                                          row.cost, row.key.kind);
    }
    if (fit != FrameTasks::Fit::kWanted) {
      RemoveUnusable(row, fit);
      continue;
    }
    std::set<uint32_t>& tiles = on_disk[row.key.frame];
    if (!is_field) tiles.insert(*frame->tasks->grid().FindTile(row.key.tile, row.key.kind));
  }
  for (const auto& [id, tiles] : on_disk) tables_.Open(id, tiles);
  for (const TaskTrouble& trouble : job.troubles) tables_.scheduler.RestoreTrouble(trouble);
  tables_.NoteEndedJobs();  // It may have failed by that.
  for (const FrameSpec& spec : job.spec.frames) {
    const FrameId id{job.spec.job_id, spec.frame_number};
    if (tables_.scheduler.FindFrame(id)->phase == FrameRecord::Phase::kRendered) queue_.Add(id);
  }
  if (!parts.rows.empty()) {
    LogInfo(absl::StrCat("job ", job.spec.job_id, ": resumed with ", parts.rows.size(),
                         " results on disk"));
  }
  // All frames were delivered, but the coordinator was stopped before it stored the job's end.
  const JobRecord& record = tables_.scheduler.jobs().at(job.spec.job_id);
  const bool is_done =
      job.delivered.size() == job.spec.frames.size() && record.unapproved_count == 0;
  if (is_done) {
    tables_.scheduler.EndJob(job.spec.job_id, JobPhase::kSucceeded, "");
    tables_.NoteEndedJobs();
  }
}

std::map<FrameId, BlobDigest> JobLifecycle::FieldsOf(const std::vector<PartRow>& rows) {
  std::map<FrameId, BlobDigest> fields;
  for (const PartRow& row : rows) {
    if (row.key.kind == TaskKind::kTraining) fields[row.key.frame] = row.digest;
  }
  for (const PartRow& row : rows) {
    if (!row.field.empty()) fields.try_emplace(row.key.frame, BlobDigest{row.field, 0});
  }
  return fields;
}

void JobLifecycle::RemoveUnusable(const PartRow& row, FrameTasks::Fit fit) {
  // A part outside its frame belongs to a later round than the one from which a refined job
  // continues.
  if (fit != FrameTasks::Fit::kOutside) {
    ++tables_.scheduler.counters().parts_revoked;
    LogWarning(absl::StrCat("job ", row.key.frame.job_id, ": a part of frame ",
                            row.key.frame.frame_number,
                            " overlaps another, or was made with another guiding field, and is "
                            "removed; samples that are lost with it are rendered again"));
  }
  removals_.Remove({row});
}

void JobLifecycle::RestoreRounds(const StoredJob& job, std::vector<StoredRound> rounds) {
  const bool live = job.phase == JobPhase::kLive;
  JobAccount& account = tables_.accounts[job.spec.job_id];
  for (StoredRound& round : rounds) {
    std::vector<RoundRecord>& of_frame = account.rounds[round.frame_number];
    if (!of_frame.empty()) of_frame.back().cells.clear();
    account.wall_before[round.frame_number] = round.record.wall_duration;
    account.job_wall_before = std::max(account.job_wall_before, round.record.wall_duration);
    if (live && !round.record.samples_next.empty()) {
      const FrameId id{job.spec.job_id, round.frame_number};
      const FrameRecord* frame = tables_.scheduler.FindFrame(id);
      if (frame != nullptr && frame->phase != FrameRecord::Phase::kDelivered) {
        tables_.scheduler.RestoreRound(id, round.record.samples_next);
      }
    }
    of_frame.push_back(std::move(round.record));
  }
}

void JobLifecycle::RestoreResumed(uint64_t job_id, const ResumedCounts& resumed) {
  for (const auto& [number, counts] : resumed) {
    tables_.scheduler.RestoreRound({job_id, number}, counts);
  }
}

JobLifecycle::TilesOnDisk JobLifecycle::RestoreResumedParts(uint64_t job_id,
                                                            const ResumedCounts& resumed) {
  TilesOnDisk on_disk;
  for (const auto& [number, counts] : resumed) {
    const FrameId id{job_id, number};
    const CellGrid& grid = tables_.scheduler.FindFrame(id)->tasks->grid();
    for (uint32_t tile = 0; tile < grid.tiles().size(); ++tile) {
      for (uint32_t i = 0; i < grid.cell_count(tile); ++i) {
        const TileCells cell = grid.CellsOf(tile, uint64_t{1} << i);
        for (const SampleBlock& block : PrefixBlocks(counts[grid.first_cell(tile) + i])) {
          tables_.scheduler.RestorePart(id, grid.tiles()[tile], block, cell, {});
        }
      }
      on_disk[id].insert(tile);
    }
    if (!grid.light_tile()) continue;
    // An image has as many light passes as its cell with the most samples (resumed_image.h).
    for (const SampleBlock& block : PrefixBlocks(std::ranges::max(counts))) {
      tables_.scheduler.RestorePart(id, grid.RectOf(*grid.light_tile()), block, {}, {},
                                    TaskKind::kLight);
    }
    on_disk[id].insert(*grid.light_tile());
  }
  return on_disk;
}

}  // namespace sheaf::coordinator
