// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Scheduler that sets tasks aside, ends frames without them, and retries them; and that
// explains why a job waits.
#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/base/memory_room.h"
#include "coordinator/scheduling/scheduler.h"

namespace sheaf::coordinator {
namespace {

TaskId FrameTroubleId(const FrameId& id) { return {id, 0, 0, 0, 0}; }

}  // namespace

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

TaskFailures& Scheduler::FailuresOf(FrameRecord* frame, const Lease& lease) {
  TaskFailures& failures = frame->failures[MakeTaskId(lease.frame, lease.task)];
  failures.trouble.frame = lease.frame;
  failures.trouble.kind = lease.kind;
  failures.trouble.tile = lease.tile_rect;
  failures.trouble.block = lease.task.block;
  failures.trouble.cells = lease.cells;
  return failures;
}

void Scheduler::NoteTrouble(const TaskId& id, const TaskFailures& failures) {
  changed_troubles_[id] = failures.trouble;
}

void Scheduler::ForgetTrouble(FrameRecord* frame, const TaskId& id) {
  const auto found = frame->failures.find(id);
  if (found == frame->failures.end()) return;
  TaskTrouble& trouble = found->second.trouble;
  if (!trouble.Empty()) {
    trouble.failures.clear();
    trouble.set_aside.clear();
    changed_troubles_[id] = trouble;
  }
  frame->failures.erase(found);
}

void Scheduler::ForgetTroubles(FrameRecord* frame) {
  while (!frame->failures.empty()) ForgetTrouble(frame, frame->failures.begin()->first);
}

void Scheduler::SetAside(FrameRecord* frame, const TaskId& id, const std::string& why) {
  TaskFailures& failures = frame->failures.at(id);
  failures.trouble.set_aside = why;
  NoteTrouble(id, failures);
  frame->tasks->SetAside(TaskOf(id));  // False while another worker still renders it.
  JobRecord& job = jobs_.at(id.frame.job_id);
  UpdateReady(&job, job.IndexOf(id.frame.frame_number));
}

void Scheduler::GiveUpFrame(JobRecord* job, uint32_t index, const std::string& why) {
  FrameRecord& frame = job->frames[index];
  const FrameId id{job->spec.job_id, frame.number()};
  TaskFailures& failures = frame.failures[FrameTroubleId(id)];
  failures.trouble.frame = id;
  failures.trouble.block = {0, 0};
  failures.trouble.set_aside = why;
  NoteTrouble(FrameTroubleId(id), failures);
  for (const uint64_t lease_id : leases_.OfJob(id.job_id)) {
    if (!(leases_.Find(lease_id)->frame == id)) continue;
    ++counters_.leases_cancelled;
    DropLease(lease_id, /*put_back=*/true);
  }
  CloseIncomplete(job, index);
}

void Scheduler::CloseIncomplete(JobRecord* job, uint32_t index) {
  Close(job, index, FrameRecord::Phase::kIncomplete);
  ++job->incomplete_count;
  ++counters_.frames_incomplete;
  incomplete_frames_.push_back({job->spec.job_id, job->frames[index].number()});
  JudgeIncompleteJob(job);
}

void Scheduler::CloseStuckFrames() {
  for (const FrameId& id : std::exchange(stuck_frames_, {})) {
    const auto job = jobs_.find(id.job_id);
    if (job == jobs_.end()) continue;
    const std::optional<uint32_t> index = job->second.FindIndex(id.frame_number);
    if (!index) continue;
    const FrameRecord& frame = job->second.frames[*index];
    if (frame.phase != FrameRecord::Phase::kOpen || !frame.tasks->Stuck()) continue;
    CloseIncomplete(&job->second, *index);
  }
}

void Scheduler::JudgeIncompleteJob(JobRecord* job) {
  const auto frame_count = static_cast<int32_t>(job->frames.size());
  if (job->incomplete_count == 0 || job->phase != JobPhase::kLive) return;
  const int32_t done_count = job->delivered_count - job->unapproved_count;
  if (done_count + job->incomplete_count < frame_count) return;
  const auto first =
      std::ranges::find(job->frames, FrameRecord::Phase::kIncomplete, &FrameRecord::phase);
  EndJob(job->spec.job_id, JobPhase::kFailed,
         absl::StrCat(job->incomplete_count, " of ", frame_count,
                      frame_count == 1 ? " frame" : " frames",
                      job->incomplete_count == 1 ? " is incomplete: " : " are incomplete, such as ",
                      "frame ", first->number(), ": ", IncompleteText(*first),
                      "; sheaf retry jobs/", job->spec.job_id, " tries again, sheaf bundle jobs/",
                      job->spec.job_id, " reproduces a failure"));
}

std::string Scheduler::TaskFailureText(const FrameRecord& frame,
                                       const TaskFailures& failures) const {
  const TaskTrouble& trouble = failures.trouble;
  return absl::StrCat("frame ", frame.number(), ", ",
                      WorkText(trouble.kind, trouble.tile, trouble.block), ": failed on ",
                      failures.Workers().empty() ? "workers that disappeared" : failures.Text(),
                      "; last: ", failures.last_words);
}

void Scheduler::RefuseForMemory(const FrameId& id, const std::string& worker_id) {
  JobRecord& job = jobs_.at(id.job_id);
  FrameRecord& frame = Frame(id);
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
    return counts[worker] >= limits_.lone_memory_failures_max;
  };
  // Lack of memory concerns the whole scene: leave it to larger machines while there are others.
  // The last machine left continues with other tasks: its failure may be a coincidence.
  std::set<std::string> refused{worker_id};
  for (const auto& [worker, kind] : frame.refused_by) refused.insert(worker);
  if (is_final(worker_id) || OthersLive(job.spec, refused)) {
    frame.refused_by[worker_id] = FailureKind::kMemory;
  } else {
    absl::erase_if(frame.refused_by, [&](const auto& entry) {
      return entry.second == FailureKind::kMemory && !is_final(entry.first);
    });
  }
  const int budget = std::min(limits_.memory_workers_max, limits_.poison_workers_max);
  const bool believed = AreBelieved(job.spec.numeric_profile, identities);
  if (static_cast<int>(identities.size()) < budget || frame.loaded || !believed) return;
  ++counters_.tasks_poisoned;
  GiveUpFrame(
      &job, job.IndexOf(id.frame_number),
      absl::StrCat(absl::StrJoin(identities, ", "), identities.size() == 1 ? " lacks" : " lack",
                   " the memory to load its scene; ", words));
}

void Scheduler::RestoreTrouble(const TaskTrouble& trouble) {
  JobRecord& job = jobs_.at(trouble.frame.job_id);
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
  if (trouble.OfFrame()) return CloseIncomplete(&job, *index);
  if (frame.phase == FrameRecord::Phase::kPending) Open(&job, *index);
  const Task task = TaskOf(id);
  if (!is_aside && failures.IsPoison(limits_)) doubtful_tasks_.insert(id);
  const bool is_left = is_aside ? frame.tasks->SetAside(task) : frame.tasks->KeepWhole(task);
  if (!is_left) return ForgetTrouble(&frame, id);  // It came before the restart.
  for (const TaskFailure& failure : trouble.failures) {
    if (failure.kind != FailureKind::kMemory) continue;
    RefuseForMemory(trouble.frame, failure.worker_id);
    if (frame.tasks == nullptr) return;
  }
  UpdateReady(&job, *index);
}

absl::Status Scheduler::Kill(const FrameId& id, std::optional<uint32_t> tile,
                             const std::string& why) {
  JobRecord& job = jobs_.at(id.job_id);
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
    ++counters_.tasks_killed;
    GiveUpFrame(&job, *index, why);
    return absl::OkStatus();
  }
  if (frame.phase == FrameRecord::Phase::kPending) Open(&job, *index);
  const CellGrid& grid = frame.tasks->grid();
  if (*tile >= grid.all_tile_count()) {
    return absl::NotFoundError(
        absl::StrCat(name, " has no task ", *tile, ", only 0 to ", grid.all_tile_count() - 1));
  }
  for (const uint64_t lease_id : leases_.OfJob(id.job_id)) {
    const Lease& lease = *leases_.Find(lease_id);
    if (!(lease.frame == id) || lease.task.tile != *tile || lease.is_check) continue;
    ++counters_.leases_cancelled;
    DropLease(lease_id, /*put_back=*/true);
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
    NoteTrouble(MakeTaskId(id, task), failures);
    ++counters_.tasks_killed;
  }
  UpdateReady(&job, *index);
  CloseStuckFrames();
  return absl::OkStatus();
}

void Scheduler::Retry(uint64_t job_id, std::optional<int32_t> number,
                      std::optional<uint32_t> tile) {
  JobRecord& job = jobs_.at(job_id);
  for (uint32_t index = 0; index < job.frames.size(); ++index) {
    FrameRecord& frame = job.frames[index];
    if (number && frame.number() != *number) continue;
    std::vector<TaskId> chosen;
    for (const auto& [id, failures] : frame.failures) {
      const bool fits = !tile || (id.tile == *tile && !failures.trouble.OfFrame());
      if (fits && !failures.trouble.Empty()) chosen.push_back(id);
    }
    for (const TaskId& id : chosen) {
      if (!frame.failures.at(id).trouble.set_aside.empty()) ++counters_.tasks_retried;
      ForgetTrouble(&frame, id);
      if (frame.tasks == nullptr) continue;
      const Task task = TaskOf(id);
      for (const Task& aside : frame.tasks->AsideOverlapping(task)) {
        if (aside == task) frame.tasks->BringBack(task);
      }
    }
    if (!tile) {
      frame.refused_by.clear();
      frame.scene_failed_by.clear();
      doubtful_frames_.erase({job_id, frame.number()});
      job.frame_loading_losses.erase(frame.number());
    }
    UpdateReady(&job, index);
  }
  if (!number) job.loading_losses.Clear();
  job.cache_refusals.clear();
}

bool Scheduler::IsHeld(const FrameRecord& frame) const {
  return !held_scenes_.empty() && held_scenes_.contains(frame.packed.scene().Hex());
}

std::string Scheduler::WhatEndsTheWait(const JobRecord& job, const FrameRecord& frame) const {
  const int live = workers_.LiveCount(job.spec.numeric_profile);
  return absl::StrCat("; to end the wait: another worker, sheaf retry jobs/", job.spec.job_id,
                      ", or sheaf kill jobs/", job.spec.job_id, " --frame ", frame.number(),
                      "; if no other worker will join the farm, sheaf-coordinator "
                      "--poison-workers ",
                      live);
}

std::string Scheduler::WhyOthersAreNeeded(const JobRecord& job) const {
  int scanned = 0;
  for (const uint32_t index : job.ready) {
    if (++scanned > limits_.avoid_scan_max) break;
    const FrameRecord& frame = job.frames[index];
    std::set<std::string> refused;
    for (const auto& [worker, kind] : frame.refused_by) refused.insert(worker);
    const auto nobody_is_left = [&](const std::set<std::string>& failed) {
      return !failed.empty() && !OthersLive(job.spec, failed);
    };
    if (nobody_is_left(refused)) {
      const auto& [worker, kind] = *frame.refused_by.begin();
      return absl::StrCat(
          "waiting for another worker: ", worker, " failed frame ", frame.number(), " by ",
          FailureKindText(kind),
          refused.size() == 1 ? "" : absl::StrCat(", and so did ", refused.size() - 1, " others"),
          WhatEndsTheWait(job, frame));
    }
    for (const auto& [id, failures] : frame.failures) {
      if (!failures.trouble.set_aside.empty()) continue;
      std::set<std::string> failed = refused;
      std::string text;
      for (const TaskFailure& failure : failures.trouble.failures) {
        if (!IsOwnFailure(failure.kind)) continue;
        failed.insert(failure.worker_id);
        absl::StrAppend(&text, text.empty() ? "" : ", ", failure.worker_id,
                        text.empty() ? " failed this task by " : " by ",
                        FailureKindText(failure.kind));
      }
      if (text.empty() || !nobody_is_left(failed)) continue;
      return absl::StrCat(
          "waiting for another worker: ", text, " (frame ", frame.number(), ", ",
          WorkText(failures.trouble.kind, failures.trouble.tile, failures.trouble.block), ")",
          WhatEndsTheWait(job, frame));
    }
  }
  return "";
}

// Even while one of the workers retries.
std::string Scheduler::WhyNoCacheHolds(const JobRecord& job) const {
  std::set<std::string> refused;
  uint64_t needed_bytes = 0, room_bytes = 0;
  for (const auto& [id, refusal] : job.cache_refusals) {
    const auto worker = workers_.workers().find(id);
    if (worker == workers_.workers().end() || !worker->second.Live()) continue;
    refused.insert(id);
    needed_bytes = std::max(needed_bytes, refusal.needed_bytes);
    room_bytes = std::max(room_bytes, refusal.room_bytes);
  }
  if (refused.empty() || OthersLive(job.spec, refused)) return "";
  return absl::StrCat("needs ", FormatMemory(needed_bytes), " of scene cache; workers have ",
                      FormatMemory(room_bytes), refused.size() == 1 ? "" : " at most",
                      " (sheaf-worker --cache-bytes-max, --cache-dir, and the disk's free space)");
}

std::string Scheduler::WaitingReason(const JobRecord& job) const {
  if (job.phase != JobPhase::kLive || job.Paused()) return "";
  if (std::string why = WhyNoCacheHolds(job); !why.empty()) return why;
  const std::vector<uint64_t> leases = leases_.OfJob(job.spec.job_id);
  if (!std::ranges::all_of(leases, [&](uint64_t id) { return leases_.Find(id)->is_check; })) {
    return "";
  }
  const FrameId first{job.spec.job_id, INT32_MIN};
  for (auto wait = check_waits_.lower_bound(first);
       job.ready.empty() && wait != check_waits_.end() && wait->first.job_id == first.job_id;
       ++wait) {
    if (std::string why = WhyAwaitsChecks(wait->first); !why.empty()) return why;
  }
  if (!leases.empty()) return "";
  if (std::string why = WhyHeld(jobs_, job); !why.empty()) return why;
  for (const FrameRecord& frame : job.frames) {
    if (held_scenes_.empty()) break;
    const bool waits =
        frame.phase == FrameRecord::Phase::kPending || frame.phase == FrameRecord::Phase::kOpen;
    if (waits && IsHeld(frame)) return held_scenes_.at(frame.packed.scene().Hex());
  }
  if (workers_.LiveCount(job.spec.numeric_profile) > 0) {
    const std::string why = WhyNobodyMay(job);
    return why.empty() ? WhyOthersAreNeeded(job) : why;
  }
  std::string other;
  bool some_are_sick = false, some_are_drained = false;
  for (const auto& [id, worker] : workers_.workers()) {
    some_are_sick |= worker.Sick() && !worker.lost;
    some_are_drained |= worker.drained && !worker.draining && !worker.lost;
    if (!worker.Live()) continue;
    other = worker.numeric_profile;
    break;
  }
  if (workers_.LiveCount() == 0) {
    return some_are_sick      ? "all connected workers are sick; sheaf workers says why"
           : some_are_drained ? "all connected workers are drained; sheaf undrain gives them work"
                              : "no worker is connected";
  }
  return absl::StrCat("no worker of the job's numeric profile \"", job.spec.numeric_profile,
                      "\" is connected; the connected workers have \"", other, "\"");
}

}  // namespace sheaf::coordinator
