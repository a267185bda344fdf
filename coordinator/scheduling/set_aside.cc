// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/set_aside.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "coordinator/scheduling/frame_phases.h"
#include "coordinator/scheduling/lease_failures.h"

namespace sheaf::coordinator {

std::string IncompleteText(const FrameRecord& frame) {
  std::string first;
  int count = 0;
  for (const auto& [id, failures] : frame.failures) {
    const std::string& why = failures.trouble.set_aside;
    if (why.empty()) continue;
    if (failures.trouble.OfFrame()) return why;
    if (++count == 1) first = why;
  }
  if (count == 0) return "";
  if (count == 1) return absl::StrCat("1 task is set aside: ", first);
  return absl::StrCat(count, " tasks are set aside, such as ", first);
}

namespace scheduling {
namespace {

TaskId FrameTroubleId(const FrameId& id) { return {id, 0, 0, 0, 0}; }

void CloseIncomplete(WorkState& state, JobRecord* job, uint32_t index) {
  Close(state, job, index, FrameRecord::Phase::kIncomplete);
  ++job->incomplete_count;
  ++state.counters.frames_incomplete;
  state.news.incomplete_frames.push_back({job->spec.job_id, job->frames[index].number()});
  JudgeIncompleteJob(state, job);
}

void GiveUpFrame(WorkState& state, JobRecord* job, uint32_t index, const std::string& why) {
  FrameRecord& frame = job->frames[index];
  const FrameId id{job->spec.job_id, frame.number()};
  TaskFailures& failures = frame.failures[FrameTroubleId(id)];
  failures.trouble.frame = id;
  failures.trouble.block = {0, 0};
  failures.trouble.set_aside = why;
  NoteTrouble(state, FrameTroubleId(id), failures);
  for (const uint64_t lease_id : state.leases.OfJob(id.job_id)) {
    if (!(state.leases.Find(lease_id)->frame == id)) continue;
    ++state.counters.leases_cancelled;
    DropLease(state, lease_id, /*put_back=*/true);
  }
  CloseIncomplete(state, job, index);
}

}  // namespace

TaskFailures& FailuresOf(FrameRecord* frame, const Lease& lease) {
  TaskFailures& failures = frame->failures[MakeTaskId(lease.frame, lease.task)];
  failures.trouble.frame = lease.frame;
  failures.trouble.kind = lease.kind;
  failures.trouble.tile = lease.tile_rect;
  failures.trouble.block = lease.task.block;
  failures.trouble.cells = lease.cells;
  return failures;
}

void NoteTrouble(WorkState& state, const TaskId& id, const TaskFailures& failures) {
  state.news.troubles[id] = failures.trouble;
}

void ForgetTrouble(WorkState& state, FrameRecord* frame, const TaskId& id) {
  const auto found = frame->failures.find(id);
  if (found == frame->failures.end()) return;
  TaskTrouble& trouble = found->second.trouble;
  if (!trouble.Empty()) {
    trouble.failures.clear();
    trouble.set_aside.clear();
    state.news.troubles[id] = trouble;
  }
  frame->failures.erase(found);
}

void ForgetTroubles(WorkState& state, FrameRecord* frame) {
  while (!frame->failures.empty()) ForgetTrouble(state, frame, frame->failures.begin()->first);
}

void SetAside(WorkState& state, FrameRecord* frame, const TaskId& id, const std::string& why) {
  TaskFailures& failures = frame->failures.at(id);
  failures.trouble.set_aside = why;
  NoteTrouble(state, id, failures);
  frame->tasks->SetAside(TaskOf(id));  // False while another worker still renders it.
  JobRecord& job = state.jobs.at(id.frame.job_id);
  UpdateReady(state, &job, job.IndexOf(id.frame.frame_number));
}

void CloseStuckFrames(WorkState& state) {
  for (const FrameId& id : std::exchange(state.doubts.stuck_frames, {})) {
    const auto job = state.jobs.find(id.job_id);
    if (job == state.jobs.end()) continue;
    const std::optional<uint32_t> index = job->second.FindIndex(id.frame_number);
    if (!index) continue;
    const FrameRecord& frame = job->second.frames[*index];
    if (frame.phase != FrameRecord::Phase::kOpen || !frame.tasks->Stuck()) continue;
    CloseIncomplete(state, &job->second, *index);
  }
}

void JudgeIncompleteJob(WorkState& state, JobRecord* job) {
  const auto frame_count = static_cast<int32_t>(job->frames.size());
  if (job->incomplete_count == 0 || job->phase != JobPhase::kLive) return;
  const int32_t done_count = job->delivered_count - job->unapproved_count;
  if (done_count + job->incomplete_count < frame_count) return;
  const auto first =
      std::ranges::find(job->frames, FrameRecord::Phase::kIncomplete, &FrameRecord::phase);
  EndJob(state, job->spec.job_id, JobPhase::kFailed,
         absl::StrCat(job->incomplete_count, " of ", frame_count,
                      frame_count == 1 ? " frame" : " frames",
                      job->incomplete_count == 1 ? " is incomplete: " : " are incomplete, such as ",
                      "frame ", first->number(), ": ", IncompleteText(*first),
                      "; sheaf retry jobs/", job->spec.job_id, " tries again, sheaf bundle jobs/",
                      job->spec.job_id, " reproduces a failure"));
}

std::string TaskFailureText(const FrameRecord& frame, const TaskFailures& failures) {
  const TaskTrouble& trouble = failures.trouble;
  return absl::StrCat("frame ", frame.number(), ", ",
                      WorkText(trouble.kind, trouble.tile, trouble.block), ": failed on ",
                      failures.Workers().empty() ? "workers that disappeared" : failures.Text(),
                      "; last: ", failures.last_words);
}

void RefuseForMemory(WorkState& state, const FrameId& id, const std::string& worker_id) {
  JobRecord& job = state.jobs.at(id.job_id);
  FrameRecord& frame = Frame(state, id);
  std::map<std::string, int> counts;
  std::set<std::string> identities;
  std::string words;
  for (const auto& [task, failures] : frame.failures) {
    for (const TaskFailure& failure : failures.trouble.failures) {
      if (failure.kind != FailureKind::kMemory) continue;
      counts[failure.worker_id] += failure.count;
      identities.insert(failure.identity);
      words = failure.words;
    }
  }
  const auto is_final = [&](const std::string& worker) {
    return counts[worker] >= state.limits.lone_memory_failures_max;
  };
  // Lack of memory concerns the whole scene: leave it to larger machines while there are others.
  // The last machine left continues with other tasks: its failure may be a coincidence.
  std::set<std::string> refused{worker_id};
  for (const auto& [worker, kind] : frame.refused_by) refused.insert(worker);
  if (is_final(worker_id) || OthersLive(state, job.spec, refused)) {
    frame.refused_by[worker_id] = FailureKind::kMemory;
  } else {
    absl::erase_if(frame.refused_by, [&](const auto& entry) {
      return entry.second == FailureKind::kMemory && !is_final(entry.first);
    });
  }
  const int budget = std::min(state.limits.memory_workers_max, state.limits.poison_workers_max);
  const bool believed = AreBelieved(state, job.spec.numeric_profile, identities);
  if (static_cast<int>(identities.size()) < budget || frame.loaded || !believed) return;
  ++state.counters.tasks_poisoned;
  GiveUpFrame(
      state, &job, job.IndexOf(id.frame_number),
      absl::StrCat(absl::StrJoin(identities, ", "), identities.size() == 1 ? " lacks" : " lack",
                   " the memory to load its scene; ", words));
}

void RestoreTrouble(WorkState& state, const TaskTrouble& trouble) {
  JobRecord& job = state.jobs.at(trouble.frame.job_id);
  const std::optional<uint32_t> index = job.FindIndex(trouble.frame.frame_number);
  if (!index || job.frames[*index].phase == FrameRecord::Phase::kDelivered) return;
  FrameRecord& frame = job.frames[*index];
  TaskId id = FrameTroubleId(trouble.frame);
  if (!trouble.OfFrame()) {
    const CellGrid grid =
        frame.tasks != nullptr ? frame.tasks->grid() : CellGrid(frame.Spec(), job.spec.partition);
    const std::optional<uint32_t> tile = grid.FindTile(trouble.tile, trouble.kind);
    const std::optional<uint64_t> cells = tile ? grid.MaskOf(*tile, trouble.cells) : std::nullopt;
    if (!cells) return;
    id = {trouble.frame, *tile, trouble.block.first, trouble.block.count, *cells};
  }
  TaskFailures& failures = frame.failures[id];
  failures.trouble = trouble;
  for (const TaskFailure& failure : trouble.failures) {
    failures.attempt_count += failure.count;
    failures.last_words = failure.words;
  }
  const bool is_aside = !trouble.set_aside.empty();
  if (frame.phase == FrameRecord::Phase::kIncomplete) return;
  if (job.phase != JobPhase::kLive) {
    if (is_aside) frame.phase = FrameRecord::Phase::kIncomplete;
    if (is_aside) ++job.incomplete_count;
    return;
  }
  if (trouble.OfFrame()) return CloseIncomplete(state, &job, *index);
  if (frame.phase == FrameRecord::Phase::kPending) Open(state, &job, *index);
  const Task task = TaskOf(id);
  if (!is_aside && failures.IsPoison(state.limits)) state.doubts.tasks.insert(id);
  const bool is_left = is_aside ? frame.tasks->SetAside(task) : frame.tasks->KeepWhole(task);
  if (!is_left) return ForgetTrouble(state, &frame, id);  // It came before the restart.
  for (const TaskFailure& failure : trouble.failures) {
    if (failure.kind != FailureKind::kMemory) continue;
    RefuseForMemory(state, trouble.frame, failure.worker_id);
    if (frame.tasks == nullptr) return;
  }
  UpdateReady(state, &job, *index);
}

absl::Status Kill(WorkState& state, const FrameId& id, std::optional<uint32_t> tile,
                  const std::string& why) {
  JobRecord& job = state.jobs.at(id.job_id);
  const std::string name = absl::StrCat("jobs/", id.job_id, "/frames/", id.frame_number);
  const std::optional<uint32_t> index = job.FindIndex(id.frame_number);
  if (!index) return absl::NotFoundError(absl::StrCat(name, ": there is no such frame"));
  if (job.phase != JobPhase::kLive) {
    return absl::FailedPreconditionError(absl::StrCat(name, ": its job has ended already"));
  }
  FrameRecord& frame = job.frames[*index];
  if (frame.phase == FrameRecord::Phase::kIncomplete) return absl::OkStatus();
  if (frame.phase == FrameRecord::Phase::kDelivered ||
      frame.phase == FrameRecord::Phase::kRendered) {
    return absl::FailedPreconditionError(absl::StrCat(name, " is rendered already"));
  }
  if (!tile) {
    ++state.counters.tasks_killed;
    GiveUpFrame(state, &job, *index, why);
    return absl::OkStatus();
  }
  if (frame.phase == FrameRecord::Phase::kPending) Open(state, &job, *index);
  const CellGrid& grid = frame.tasks->grid();
  if (*tile >= grid.all_tile_count()) {
    return absl::NotFoundError(
        absl::StrCat(name, " has no task ", *tile, ", only 0 to ", grid.all_tile_count() - 1));
  }
  for (const uint64_t lease_id : state.leases.OfJob(id.job_id)) {
    const Lease& lease = *state.leases.Find(lease_id);
    if (!(lease.frame == id) || lease.task.tile != *tile || lease.is_check) continue;
    ++state.counters.leases_cancelled;
    DropLease(state, lease_id, /*put_back=*/true);
  }
  for (const Task& task : frame.tasks->SetTileAside(*tile)) {
    TaskFailures& failures = frame.failures[MakeTaskId(id, task)];
    failures.trouble.frame = id;
    failures.trouble.kind = grid.KindOf(*tile);
    failures.trouble.tile = grid.RectOf(*tile);
    failures.trouble.block = task.block;
    failures.trouble.cells = grid.CellsOf(*tile, task.cells);
    failures.trouble.set_aside =
        absl::StrCat("frame ", id.frame_number, ", ",
                     WorkText(failures.trouble.kind, failures.trouble.tile, task.block), ": ", why);
    NoteTrouble(state, MakeTaskId(id, task), failures);
    ++state.counters.tasks_killed;
  }
  UpdateReady(state, &job, *index);
  CloseStuckFrames(state);
  return absl::OkStatus();
}

void Retry(WorkState& state, uint64_t job_id, std::optional<int32_t> number,
           std::optional<uint32_t> tile) {
  JobRecord& job = state.jobs.at(job_id);
  for (uint32_t index = 0; index < job.frames.size(); ++index) {
    FrameRecord& frame = job.frames[index];
    if (number && frame.number() != *number) continue;
    std::vector<TaskId> chosen;
    for (const auto& [id, failures] : frame.failures) {
      const bool fits = !tile || (id.tile == *tile && !failures.trouble.OfFrame());
      if (fits && !failures.trouble.Empty()) chosen.push_back(id);
    }
    for (const TaskId& id : chosen) {
      if (!frame.failures.at(id).trouble.set_aside.empty()) ++state.counters.tasks_retried;
      ForgetTrouble(state, &frame, id);
      if (frame.tasks == nullptr) continue;
      const Task task = TaskOf(id);
      for (const Task& aside : frame.tasks->AsideOverlapping(task)) {
        if (aside == task) frame.tasks->BringBack(task);
      }
    }
    if (!tile) {
      frame.refused_by.clear();
      frame.scene_failed_by.clear();
      state.doubts.frames.erase({job_id, frame.number()});
      job.frame_loading_losses.erase(frame.number());
    }
    UpdateReady(state, &job, index);
  }
  if (!number) job.loading_losses.Clear();
  job.cache_refusals.clear();
}

}  // namespace scheduling
}  // namespace sheaf::coordinator
