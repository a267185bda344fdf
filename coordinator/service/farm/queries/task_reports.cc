// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/queries/task_reports.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "coordinator/core/job/cell_grid.h"

namespace sheaf::coordinator {
namespace {

// The subject of a report, the most informative first.
enum class Rank { kTaskSetAside, kFrameGivenUp, kScene, kTaskFailed, kLogged, kNone };

CellGrid GridOf(const JobRecord& job, const FrameRecord& frame) {
  return frame.tasks != nullptr ? frame.tasks->grid() : CellGrid(frame.Spec(), job.spec.partition);
}

// The failure with the worker's own message, without the worker's name.
TaskFailure OwnWords(TaskFailure failure) {
  const std::string words = failure.words;
  const std::string speaker = absl::StrCat("worker ", failure.worker_id, " says: ");
  failure.words = std::string(absl::StripPrefix(words, speaker));
  return failure;
}

// The first task of a frame.
uint32_t FirstTileOf(const CellGrid& grid) { return grid.training_tile().value_or(0); }

// Makes the report describe the first block of the tile.
void TakeFirstBlock(const JobRecord& job, const CellGrid& grid, uint32_t tile, TaskReport* report) {
  report->task = tile;
  report->kind = grid.KindOf(tile);
  report->tile = grid.RectOf(tile);
  const uint64_t most = std::min(report->spec.settings.samples,
                                 std::max<uint64_t>(1, job.spec.partition.pass_sample_count));
  report->block = {0, report->kind == TaskKind::kTraining ? 1 : std::bit_floor(most)};
  report->cells = {};
}

void TakeTrouble(const TaskId& id, const TaskTrouble& trouble, TaskReport* report) {
  report->task = id.tile;
  report->kind = trouble.kind;
  report->tile = trouble.tile;
  report->block = trouble.block;
  report->cells = trouble.cells;
  report->set_aside = trouble.set_aside;
  for (const TaskFailure& failure : trouble.failures) report->failures.push_back(OwnWords(failure));
}

// The frame is given up: no worker could load its scene, or a user killed it.
void TakeFrameTrouble(const JobRecord& job, const FrameRecord& frame, const TaskTrouble& trouble,
                      TaskReport* report) {
  const CellGrid grid = GridOf(job, frame);
  TakeFirstBlock(job, grid, FirstTileOf(grid), report);
  report->whole_frame = true;
  report->set_aside = trouble.set_aside;
  for (const auto& [id, failures] : frame.failures) {
    for (const TaskFailure& failure : failures.trouble.failures) {
      if (failure.kind == FailureKind::kMemory) report->failures.push_back(OwnWords(failure));
    }
  }
}

void TakeLogged(const JobRecord& job, const FrameRecord& frame, uint32_t tile,
                const FailureRecord& logged, TaskReport* report) {
  const CellGrid grid = GridOf(job, frame);
  report->whole_frame = logged.kind == FailureKind::kScene;
  TakeFirstBlock(job, grid, report->whole_frame ? FirstTileOf(grid) : tile, report);
  if (!report->whole_frame && logged.block.count > 0) report->block = logged.block;
  report->failures = {TaskFailure{logged.worker_id, "", logged.kind, 1, logged.message}};
}

TaskReport ReportOf(const JobRecord& job, const FrameRecord& frame) {
  TaskReport report;
  report.frame = {job.spec.job_id, frame.number()};
  report.spec = frame.Spec();
  report.numeric_profile = job.spec.numeric_profile;
  return report;
}

absl::Status NoSuch(uint64_t job_id, const std::string& what) {
  return absl::NotFoundError(absl::StrCat("jobs/", job_id, ": ", what));
}

}  // namespace

absl::StatusOr<TaskReport> TaskReports::Choose(uint64_t job_id, std::optional<int32_t> number,
                                               std::optional<uint32_t> tile) const {
  const MutexLock lock(&tables_.mutex);
  const absl::StatusOr<const JobRecord*> found = tables_.FindJob(job_id);
  if (!found.ok()) return found.status();
  const JobRecord& job = **found;
  if (number && !job.FindIndex(*number)) return NoSuch(job_id, absl::StrCat("no frame ", *number));
  Rank best = Rank::kNone;
  TaskReport report;
  const auto is_better = [&](Rank rank, const FrameRecord& frame) {
    if (rank >= best) return false;
    best = rank;
    report = ReportOf(job, frame);
    return true;
  };
  for (const FrameRecord& frame : job.frames) {
    if (number && frame.number() != *number) continue;
    for (const auto& [id, failures] : frame.failures) {
      const TaskTrouble& trouble = failures.trouble;
      if (trouble.Empty() || (tile && (trouble.OfFrame() || id.tile != *tile))) continue;
      if (trouble.OfFrame()) {
        if (is_better(Rank::kFrameGivenUp, frame)) TakeFrameTrouble(job, frame, trouble, &report);
        continue;
      }
      const Rank rank = trouble.set_aside.empty() ? Rank::kTaskFailed : Rank::kTaskSetAside;
      if (is_better(rank, frame)) TakeTrouble(id, trouble, &report);
    }
  }
  for (auto logged = job.failures.last.rbegin(); logged != job.failures.last.rend(); ++logged) {
    const std::optional<uint32_t> index = job.FindIndex(logged->frame_number);
    if (!index || (number && logged->frame_number != *number)) continue;
    const Rank rank = logged->kind == FailureKind::kScene ? Rank::kScene : Rank::kLogged;
    if (rank >= best) continue;
    const FrameRecord& frame = job.frames[*index];
    const std::optional<uint32_t> of = GridOf(job, frame).FindTile(logged->tile, logged->task_kind);
    if (!of || (tile && *of != *tile)) continue;
    if (is_better(rank, frame)) TakeLogged(job, frame, *of, *logged, &report);
  }
  if (best != Rank::kNone) return report;
  if (!number) {
    return NoSuch(job_id, "no task of it has failed; name one, by its frame and its number");
  }
  const FrameRecord& frame = job.frames[*job.FindIndex(*number)];
  const CellGrid grid = GridOf(job, frame);
  if (tile.value_or(0) >= grid.all_tile_count()) {
    return NoSuch(job_id, absl::StrCat("frame ", *number, " has no task ", *tile, ", only 0 to ",
                                       grid.all_tile_count() - 1));
  }
  report = ReportOf(job, frame);
  TakeFirstBlock(job, grid, tile.value_or(FirstTileOf(grid)), &report);
  report.whole_frame = !tile;
  return report;
}

absl::StatusOr<TaskReport> TaskReports::Find(uint64_t job_id, std::optional<int32_t> number,
                                             std::optional<uint32_t> tile) const {
  absl::StatusOr<TaskReport> report = Choose(job_id, number, tile);
  if (!report.ok()) return report.status();
  const FrameSettings& settings = report->spec.settings;
  if (!NeedsTraining(settings.techniques) || report->kind == TaskKind::kTraining) return report;
  const absl::StatusOr<std::optional<PartRow>> field =
      store_.FindPart({report->frame, settings.window, {0, 1}, {}, TaskKind::kTraining});
  if (!field.ok()) return field.status();
  if (field->has_value()) {
    report->guiding_field = **field;
    return report;
  }
  return absl::FailedPreconditionError(
      absl::StrCat("jobs/", job_id, ": the guiding field of frame ", report->frame.frame_number,
                   " is not kept, and the task cannot be rendered without it; sheaf retry trains "
                   "another one"));
}

}  // namespace sheaf::coordinator
